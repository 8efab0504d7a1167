"""The report's folder: figures for machines, a page for people, plots and the reference; whole or not at all.

report.json holds, numbers as numbers and unknown ones as null:

- "made": how; "baseline"; "interrupted"; "left_out": [{asked, reason}]; "doubles": [{asked, same_as}]
- "words": sentences, [{kind, text}]; "files": what else is in the folder
- "reference": source, spp, variance_known, mean (of the image), rms_error (its own standard error)
- "combinations": a list of
  - label, options, names (by family), biased, notes, spp, seeds, precompute_seconds, kernel_seconds
  - round_seconds, round_lookups: of each round
  - equal_time: spp, seconds, seed, relrmse and flip (null where it is not installed) of the picture
  - one_render, lists over lengths: spp; seconds, lookups of one render; relmse, low, high: its relative MSE
  - curve: seconds, lookups (spent for the mean of 1, 2, … rounds); mse, relmse, rmse, relrmse, each value,
    low, high: of means of separate renders
  - slope (over the number of renders), render_slope (of one render, over its samples): value, low, high
  - squared_bias, relative_squared_bias
  - worst_round_share
  - efficiency (of renders of spp samples) by "seconds" and "lookups": value, ratio {value, low, high}, p,
    adjusted_p, significant
  - largest_error: x, y, channel, difference, deviation
  - verdict: the fields of `clvol.lab.agreement.Agreement`
"""

from __future__ import annotations

import dataclasses
import json
import os
import secrets
import shutil
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.extras import need_matplotlib
from clvol.base.output_files import check_room, kept_elsewhere, new_file, real, sync_folder
from clvol.errors import OptionError
from clvol.lab.comparison.html import html_report
from clvol.lab.comparison.plots import plots
from clvol.lab.comparison.words import sentences
from clvol.picture import image_io

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from clvol.lab.comparison.figures import Curve, Figures
    from clvol.lab.comparison.findings import Findings

KIND = "clvol compare"
_LEAST_BYTES = 2**18
"""No report is smaller."""
_JSON, _HTML, _REFERENCE = "report.json", "report.html", "reference.exr"


def check_folder(folder: str | os.PathLike[str], read: Sequence[str] = ()) -> None:
    """Raise OptionError now for a folder that `write_report` could not or should not replace later.

    read : files of the scene, none of which may be in the folder.
    """
    need_matplotlib("a report")
    where, target = os.fspath(folder), real(folder)
    if target.exists() and not target.is_dir():
        raise OptionError("is a file, and a report is a folder", where=where)
    for name in read:
        if target in real(name).parents:
            raise OptionError(f"holds '{name}', which the scene is read from", where, "take another folder")
    if target.is_dir():
        foreign = sorted({p.name for p in target.iterdir()} - _own_files(target))
        if foreign:
            raise OptionError(
                f"holds {foreign[0]!r}, which is not of an earlier report",
                where=where,
                hint="take another folder",
            )
    check_room(target.parent, where, _LEAST_BYTES)


def write_report(findings: Findings, folder: str | os.PathLike[str]) -> None:
    """Write the folder; an earlier report of that name is replaced once the new one is complete.

    OptionError as `check_folder` says, and as `write_or_keep`.
    """
    check_folder(folder, findings.files)
    write_or_keep(findings, folder)


def write_or_keep(findings: Findings, folder: str | os.PathLike[str]) -> None:
    """Write the folder, or, where that fails, as on a full disk, another one; OptionError then says which."""
    files = _files(findings)
    try:
        check_folder(folder, findings.files)
        _replace(real(folder), files)
    except (OSError, OptionError) as error:
        name = f"clvol-report-{secrets.token_hex(4)}"
        kept = kept_elsewhere(folder, name, lambda place: _write_new(place, files))
        hint = f"the report is kept as {kept}" if kept else "and there is no other place to keep the report"
        what = error.what if isinstance(error, OptionError) else f"cannot be written: {error.strerror}"
        raise OptionError(what, os.fspath(folder), hint) from error


def _replace(target: Path, files: dict[str, bytes]) -> None:
    """The folder with these files and no others; as it was where that fails, with OSError."""
    made = target.with_name(f".clvol-{secrets.token_hex(4)}")
    old = made.with_name(made.name + ".old")
    try:
        _write_new(made, files)
        if target.exists():
            shutil.copymode(target, made)
            target.rename(old)
        made.rename(target)
        sync_folder(target.parent)
    finally:
        if old.exists() and not target.exists():
            old.rename(target)
        shutil.rmtree(made, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)


def _write_new(folder: Path, files: dict[str, bytes]) -> None:
    """A folder that was not there; nothing where that fails, with OSError."""
    try:
        folder.mkdir()
        for name, data in files.items():
            with new_file(folder / name) as file:
                file.write(data)
        sync_folder(folder)
    except OSError:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _own_files(folder: Path) -> set[str]:
    """Names that an earlier report says it wrote; none if there is no such report."""
    try:
        written = json.loads((folder / _JSON).read_text(encoding="utf-8"))
        return {_JSON, *map(str, written["files"])} if written["kind"] == KIND else set()
    except (OSError, ValueError, KeyError, TypeError):
        return set()


def _files(findings: Findings) -> dict[str, bytes]:
    """What is in the folder, by name."""
    drawn = plots(findings)
    files = {f"{name}.png": png for name, png in drawn.items()}
    files[_HTML] = html_report(findings, drawn).encode("utf-8", "backslashreplace")
    reference = findings.reference
    channels = image_io.split_channels("", reference.image)
    if reference.variance_known:
        channels |= image_io.split_channels("variance", reference.variance)
    files[_REFERENCE] = image_io.encode_exr(channels, _reference_metadata(findings))
    text = json.dumps(as_json(findings) | {"files": sorted(files)}, indent=1, allow_nan=False)
    return files | {_JSON: (text + "\n").encode()}


def _reference_metadata(findings: Findings) -> dict[str, Any]:
    about = findings.about
    known = {"scene": about.get("scene"), "digest": about.get("digest"), "version": about.get("clvol")}
    known |= {"spp": findings.reference.spp, "dof": len(findings.reference.rounds) - 1}
    known |= {"reference": findings.reference.source}
    if findings.reference.seeds is not None:
        known["seeds"] = "{} {}".format(*findings.reference.seeds)
    return {name: value for name, value in known.items() if value is not None}


def as_json(findings: Findings) -> dict[str, Any]:
    """Everything in report.json but the names of files; what is not finite is None."""
    reference = findings.reference
    plain: dict[str, Any] = _plain(
        {
            "kind": KIND,
            "made": findings.about,
            "baseline": findings.baseline,
            "interrupted": findings.interrupted,
            "left_out": [{"asked": said, "reason": why} for said, why in findings.left_out],
            "doubles": [{"asked": said, "same_as": label} for said, label in findings.doubles],
            "words": [dataclasses.asdict(sentence) for sentence in sentences(findings)],
            "reference": {
                "source": reference.source,
                "spp": reference.spp,
                "variance_known": reference.variance_known,
                "mean": float(reference.image.mean()),
                "rms_error": float(np.sqrt(reference.variance.mean())),
            },
            "combinations": [_combination(f) for f in findings.figures],
        }
    )
    return plain


def _combination(f: Figures) -> dict[str, Any]:
    m = f.measured
    return {
        "label": f.label,
        "options": m.trial.options,
        "names": m.trial.names,
        "biased": f.biased,
        "notes": m.notes,
        "spp": m.spp,
        "seeds": m.seeds,
        "precompute_seconds": m.trial.precompute_seconds,
        "kernel_seconds": m.trial.session.kernel_seconds,
        "round_seconds": m.seconds,
        "round_lookups": m.lookups,
        "curve": {
            "seconds": f.seconds,
            "lookups": f.lookups,
            "mse": _ends(f.mse, 1.0),
            "relmse": _ends(f.relmse, 1.0),
            "rmse": _ends(f.mse, 0.5),
            "relrmse": _ends(f.relmse, 0.5),
        },
        "equal_time": {
            "spp": f.picture.render.spp,
            "seconds": f.picture.render.seconds,
            "seed": f.picture.render.seed,
            "relrmse": f.picture.relrmse,
            "flip": f.picture.mean_flip,
        },
        "one_render": f.one_render._asdict(),
        "slope": f.slope,
        "render_slope": f.render_slope,
        "squared_bias": f.squared_bias,
        "relative_squared_bias": f.relative_squared_bias,
        "worst_round_share": f.worst_round,
        "efficiency": f.efficiency,
        "largest_error": f.largest_error,
        "verdict": f.verdict,
    }


def _ends(curve: Curve, power: float) -> dict[str, np.ndarray]:
    parts = {"value": curve.value, "low": curve.low, "high": curve.high}
    return {name: v if power == 1 else np.maximum(v, 0.0) ** power for name, v in parts.items()}


def _plain(value: Any) -> Any:
    """Lists, dictionaries, numbers and text only; None for numbers that are not finite."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(name): _plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
