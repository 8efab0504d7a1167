"""Integrators: path length limits, and the estimator choices a scene may carry."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from clvol.errors import option
from clvol.scene.records import Integrator

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.scene.reader import Reader

CHOICES = (
    "technique",
    "transmittance",
    "majorant",
    "lookup",
    "absorption",
    "gathering",
    "roulette",
    "background",
    "probability",
    "control",
    "sampler",
    "shadow_cache",
    "light_choice",
    "lamp_edges",
    "next_event",
    "lanes",
)
"""Parameters handed on as strings; what they may say is for the registry of techniques to judge."""


@dataclass(frozen=True)
class Chosen:
    """An integrator, and whether it looks into media; `name` is the plugin's."""

    integrator: Integrator
    media: bool = True
    name: str = "volpath"


@dataclass(frozen=True)
class Other:
    """An integrator of Mitsuba whose expectation is a path tracer's, by which it is served.

    ignored : its own parameters, by type, which change noise, cost or derivatives.  max_depth : its default.
    fixed : it has no max_depth to set.
    """

    media: bool
    ignored: Mapping[str, type] = field(default_factory=dict)
    max_depth: int = -1
    fixed: bool = False


_PROJECTIVE = {
    **dict.fromkeys(("sppc", "sppp", "sppi", "guiding_rounds"), int),
    **{"guiding": str, "guiding_proj": bool, "project_seed": str},
}
_SAMPLES = dict.fromkeys(("shading_samples", "emitter_samples", "bsdf_samples"), int)
_MUTATIONS = {
    **dict.fromkeys(("luminance_samples", "direct_samples", "chains", "max_chains", "chain_length"), int),
    **dict.fromkeys(("p_large", "lambda"), float),
    **dict.fromkeys(
        ("two_stage", "bidirectional", "bidirectional_mutation", "lens_perturbation", "caustic_perturbation"),
        bool,
    ),
    **dict.fromkeys(("multi_chain_perturbation", "manifold_perturbation", "multiplexed"), bool),
}
_PHOTONS = {
    **dict.fromkeys(("direct_samples", "glossy_samples", "global_photons", "caustic_photons"), int),
    **dict.fromkeys(("volume_photons", "photon_count", "lookup_size", "granularity", "min_photons"), int),
    **dict.fromkeys(("global_lookup_radius", "caustic_lookup_radius", "initial_radius", "alpha"), float),
    **dict.fromkeys(("max_passes", "caustic_lookup_size", "volume_lookup_size"), int),
}
BEFORE = {
    "volpath_simple": Other(True),
    "bdpt": Other(True, {"light_image": bool, "sample_direct": bool}),
    **{name: Other(True, _PHOTONS) for name in ("photonmapper", "photonmap", "ppm", "sppm")},
    **{name: Other(True, _MUTATIONS) for name in ("mlt", "pssmlt", "erpt")},
}
"""Those of Mitsuba before version 2, which all have what `volpath` has."""
OTHERS: dict[str, Other] = {
    "prbvolpath": Other(True, max_depth=6),
    "prb": Other(False, max_depth=6),
    "prb_basic": Other(False, max_depth=6),
    "prb_projective": Other(False, _PROJECTIVE, max_depth=6),
    "direct_projective": Other(False, _PROJECTIVE | _SAMPLES, 2, fixed=True),
    "direct": Other(False, _SAMPLES, 2, fixed=True),
    "ptracer": Other(False),
    **BEFORE,
}
"""Integrators that are served by ours, with what they differ in."""


def volpath(reader: Reader) -> Chosen:
    """The `volpath` and `volpathmis` plugins, which have the same parameters and the same expectation."""
    choices = {name: reader.string(name, "") for name in CHOICES if reader.has(name)}
    if reader.type == "volpathmis":
        reader.ignore(use_spectral_mis=bool)
    return Chosen(_limits(reader, choices), True, reader.type)


def path(reader: Reader) -> Chosen:
    """The `path` plugin, for scenes without media."""
    return Chosen(_limits(reader, {}), False, reader.type)


def other(reader: Reader) -> Chosen:
    """One of `OTHERS`: its primal picture, of the same limits."""
    this = OTHERS[reader.type]
    reader.ignore(**this.ignored)
    if this.fixed:
        _technical(reader)
        limits = Integrator(this.max_depth, hide_emitters=reader.boolean("hide_emitters", False))
    else:
        limits = _limits(reader, {}, this.max_depth)
    reader.approximated(
        f"{'volpath' if this.media else 'path'}, which has the same expectation"
        + (f" (max_depth {limits.max_depth})" if limits.max_depth >= 0 else "")
    )
    return Chosen(limits, this.media, reader.type)


def depth(reader: Reader) -> Chosen:
    """The `depth` plugin: the distance to the first surface on each ray, 0 where there is none."""
    _technical(reader)
    reader.ignore(hide_emitters=bool)
    return Chosen(Integrator(shows_depth=True), True, reader.type)


def moment(reader: Reader) -> Chosen:
    """The `moment` plugin: every render measures its variance, so it is the integrator inside."""
    return _inside(reader)


def wrapper(reader: Reader) -> Chosen:
    """One of `WRAPPERS`: what it adds changes no expectation, so it is the integrator inside."""
    reader.ignore(**WRAPPERS[reader.type])
    chosen = _inside(reader)
    reader.approximated(f"the integrator inside, '{chosen.name}'")
    return chosen


WRAPPERS: dict[str, dict[str, type]] = {
    "adaptive": {"max_error": float, "p_value": float, "max_sample_factor": int},
    "irrcache": {"resolution": int, "quality": float, "gradients": bool, "overture": bool, "debug": bool},
    "nanscrub": {},
}
"""Integrators of Mitsuba before version 2 that hold another one, and their own parameters, by type."""

AOVS = {"albedo": "albedo", "depth": "depth", "position": "position", "sh_normal": "normal"}
"""What the `aov` plugin calls pictures that a result can have, and ours."""


def aov(reader: Reader) -> Chosen:
    """The `aov` plugin: the integrator inside, and more pictures, means over what paths first meet."""
    names = []
    for part in reader.string("aovs", "").split(","):
        if not part.strip():
            continue
        given, _, kind = part.strip().rpartition(":")
        if kind not in AOVS or not given:
            hint = f"write name:type, with types {', '.join(AOVS)}"
            reader.unsupported(f"aov '{part.strip()}' is not supported", "aovs", hint)
        names.append(AOVS[kind])
    chosen = _inside(reader, optional=True)
    if names:
        reader.approximated(f"the integrator inside, and the pictures {', '.join(names)} of first hits")
    return replace(chosen, integrator=replace(chosen.integrator, aovs=tuple(dict.fromkeys(names))))


def _inside(reader: Reader, optional: bool = False) -> Chosen:
    _technical(reader)
    reader.ignore(hide_emitters=bool)  # that of the one inside counts
    inner = reader.only_child("integrator")
    if inner is None and optional:
        return Chosen(Integrator())
    if inner is None:
        what = f"integrator '{reader.type}' holds another one, this one is empty"
        reader.fail(what, hint="volpath, for instance")
    chosen: Chosen = reader.build(inner)
    return chosen


def _limits(reader: Reader, choices: dict[str, str], max_depth: int = -1) -> Integrator:
    _technical(reader)
    return Integrator(
        max_depth=reader.integer("max_depth", max_depth, -1),
        rr_depth=reader.integer("rr_depth", 5, 1),
        hide_emitters=reader.boolean("hide_emitters", False),
        choices=choices,
    )


def _technical(reader: Reader) -> None:
    """How Mitsuba goes about its work, which changes no expectation; a limit of time is the order's."""
    reader.ignore(samples_per_pass=int, block_size=int)
    if reader.number("timeout", -1.0) > 0:
        reader.approximated(f"no limit: {option('time', 60)} ends a render after a time", "timeout")
