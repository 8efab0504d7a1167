"""Files under cl/ include what they use, hide what a scene does not, and hold nothing that is not used."""

import re
from collections import Counter
from pathlib import Path

import pytest

from clvol import layout
from clvol.device import programs
from clvol.device.preprocess import Preprocessor
from clvol.planning import registry
from clvol.planning.choices import Choices
from clvol.planning.features import Features
from clvol.planning.plan import Plan
from clvol.planning.settled import Settled

CL = Path(__file__).resolve().parents[2] / "cl"
HEADERS = sorted(str(p.relative_to(CL)) for p in CL.rglob("*.h"))
TEXTS = {str(p.relative_to(CL)): p.read_text(encoding="utf-8") for p in sorted(CL.rglob("*.[hc]*"))}

FILES = {
    "a.h": "#ifndef A_H\n#define A_H\nint a;\n#endif\n",
    "guarded.h": '/* why */\n#ifndef G_H\n#define G_H\n#if CLVOL_X\n#include "a.h"\nint g;\n#endif\n#endif\n',
    "branches.h": "#if CLVOL_N == 1\none\n#elif CLVOL_N > 1 && !CLVOL_X\nmany\n#else\nnone\n#endif\n",
    "left.h": "#if CLVOL_X\n#ifdef __AVX__\nfast\n#else\nslow\n#endif\n#elif OTHER\nother\n#endif\nend\n",
}


def lines(text, slots=None, **macros):
    """What is left of `text`, but for `#line`."""
    expander = Preprocessor(FILES.__getitem__, {f"CLVOL_{n}": v for n, v in macros.items()}, slots or {})
    return [line for line in expander.expand(text, "unit") if not line.startswith("#line")]


def test_a_file_stands_once_and_where_it_comes_first():
    assert lines('#include "a.h"\nb\n#include "a.h"\n') == [
        "#ifndef A_H",
        "#define A_H",
        "int a;",
        "#endif",
        "b",
    ]


def test_a_file_of_which_nothing_is_left_leaves_no_trace():
    assert lines('#include "guarded.h"\nend', X=0) == ["end"]
    assert {"int a;", "int g;"} <= set(lines('#include "guarded.h"\nend', X=1))


@pytest.mark.parametrize(
    ("n", "x", "left"), [(1, 0, "one"), (1, 1, "one"), (2, 0, "many"), (2, 1, "none"), (0, 0, "none")]
)
def test_one_branch_is_left(n, x, left):
    assert lines('#include "branches.h"', N=n, X=x) == [left]


def test_what_macros_do_not_decide_is_left_to_the_compiler():
    assert lines('#include "left.h"', X=1) == ["#ifdef __AVX__", "fast", "#else", "slow", "#endif", "end"]
    assert lines('#include "left.h"', X=0) == ["#if OTHER", "other", "#endif", "end"]
    assert lines("#if CLVOL_X\nx\n#endif", Y=1) == ["#if CLVOL_X", "x", "#endif"]


def test_a_slot_is_filled_and_an_empty_one_is_noticed():
    assert "int a;" in lines("#include CLVOL_CHOSEN", {"CLVOL_CHOSEN": "a.h"})
    assert lines("#if CLVOL_X\n#include CLVOL_CHOSEN\n#endif", X=0) == []
    with pytest.raises(KeyError):
        lines("#include CLVOL_CHOSEN")


def test_lines_are_numbered_as_in_their_files():
    expander = Preprocessor(FILES.__getitem__, {"CLVOL_X": 0}, {})
    text = 'first\n#if CLVOL_X\nhidden\n#endif\n#include "left.h"\nlast'
    number, place, found = 0, "", {}
    for line in expander.expand(text, "unit"):
        if match := re.match(r'#line (\d+) "(.*)"', line):
            number, place = int(match[1]), match[2]
        else:
            found[line] = (place, number)
            number += 1
    assert found["first"] == ("unit", 1) and found["last"] == ("unit", 6)
    assert found["other"] == ("left.h", 8) and found["end"] == ("left.h", 10)


# -- cl/ ---------------------------------------------------------------------------------------------


def everything(**features):
    """A plan for which no file is empty, with light that is gathered on walks."""
    found = {name: True for name, kind in Features.__annotations__.items() if kind == "bool"}
    found |= {"media": 2, "volumes": 1, "surfaces": 1, "emitters": 1, "boundaries": 1}
    found |= {"bsdfs": layout.BSDFS, "phases": layout.ENUMS["PHASE"]}
    found["media_overlap"] = False
    choices = Choices(
        technique="decomposition",
        transmittance="residual-ratio",
        absorption="sample",
        sampler="sobol",
        aov=tuple(registry.AOVS),
    )
    return Plan.for_features(Features(**found | features), choices).settle(Settled("grid", top_trees=True))


@pytest.mark.parametrize("name", ["kernels/accumulate.cl", "ray/places.cl", "ray/tables.cl", "ray/walks.cl"])
def test_every_kernel_includes_what_it_uses_with_and_without_surfaces(device, name):
    features = Features(media=1, homogeneous=True, emitters=1, constant=True, phases=("HG",), scattering=True)
    for plan in everything(), Plan.for_features(features, Choices()).settle(Settled("none")):
        macros = {macro: 0 for macro in re.findall(r"CLVOL_RAY_\w+", TEXTS[name])}
        programs.build(device, programs.compose(plan, f'#include "{name}"\n', macros), name)


def test_every_file_is_included_by_another_or_fills_a_slot():
    included = {name for text in TEXTS.values() for name in re.findall(r'#include "(.+)"', text)}
    chosen = {choice.header for family in registry.FAMILIES.values() for choice in family.values()}
    chosen |= {f"stages/{stage.name}.h" for stage in layout.STAGES}
    others = {"majorant/tree_grid.h", "tracking/delta_through.h"}
    assert set(HEADERS) - included - chosen == others, "grids of sparse volumes, and background `expected`"
    assert included <= {*HEADERS, "kernels/lanes.cl"}


CODE = {name: re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL) for name, text in TEXTS.items()}
ALL = "\n".join(CODE.values())


DEFINED = re.compile(
    r"^(?:INLINE|__constant)\b[^\n(=;]*?\b(\w+)[(\[]|^\s*#define (\w+)|^\} (?:__attribute__\S+ )?(\w+);"
    r"|^typedef [^\n{]*?\b(\w+);",
    re.M,
)
USED = re.compile(r"(?<![.>\w])([A-Z]\w+|\w+(?=\())")
"""Macros and types, which are capital, and functions that are called; no members."""


def code(text):
    """Text without comments, and without directives but `#define`."""
    return re.sub(r"^\s*#(?!define)[^\n]*\n", "", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL), flags=re.M)


def defined(text):
    return {name for names in DEFINED.findall(text) for name in names if name}


def unit_of(plan, name):
    """A header with all that it includes, those of a stage with its contract."""
    contracts = {f"stages/{stage.name}.h": stage for stage in layout.STAGES}
    for stage, names in {
        "medium_sample": ("segment_sample", "sample_lanes"),
        "shadow_transmittance": ("shadow_ray", "shadow_lanes"),
    }.items():
        contracts |= {f"stages/{name}.h": layout.stage(stage) for name in names}
    macros = {"CLVOL_LANES": 8} if "lane" in name else {}
    if name in ("stages/background.h", "tracking/delta_through.h", "emitter/sunlit.h"):
        macros |= {"CLVOL_EXPECTS_BACKGROUND": 1, "CLVOL_SUN_CONTROL": 1}
    if name == "stages/direction_control.h":  # not where a phase function is a table
        macros["CLVOL_DIRECTION_CONTROL"] = 1
    return programs.compose(plan, f'#include "{name}"\n', macros, stage=contracts.get(name))


def test_every_header_includes_what_it_uses():
    """Of what is defined anywhere, a header with all that it includes lacks nothing that it names.

    No compiler is asked, which would have to read each header a hundred times over.
    """
    plan = everything()
    generated = [layout.layout_text(plan.macros), layout.kinds_text("BSDF"), layout.kinds_text("PHASE")]
    generated += [layout.shared_text(), *(layout.stage_text(plan.macros, stage) for stage in layout.STAGES)]
    known = defined("\n".join([ALL, *generated])) - {"Bits"}  # a macro's parameter, too
    assert len(known) > 900 and {"Spectrum", "MediumRay", "NO_JOB", "path_beta", "spectral_rate"} <= known
    for name in HEADERS:
        unit = unit_of(plan, name)
        assert f'"{name}"' in unit, f"{name} is empty"
        text = code(unit)
        assert not known & set(USED.findall(text)) - defined(text), f"{name} does not include what it uses"


def test_members_are_named_in_full_beside_their_arrow():
    """By these names it is seen which buffers a unit uses; the others are null there."""
    assert not re.search(r"->\s|->\w*##|##\w*(?:->|\.)", ALL)


def test_nothing_is_defined_that_nothing_uses():
    defined = {
        (name, word)
        for name, text in CODE.items()
        for word in re.findall(r"^INLINE [^\n(]*?\b(\w+)\(|^\s*#define (\w+)|^\} (\w+);", text, re.M)
        for word in word
        if word and not word.endswith("_H")
    }
    assert len(defined) > 300
    plan = everything()
    text = ALL + "".join(layout.stage_text(plan.macros, stage) for stage in layout.STAGES)
    times = Counter(re.findall(r"\w+", text))
    assert [place for place in sorted(defined) if times[place[1]] == 1] == []


def test_every_macro_is_known_and_used():
    plan = everything()
    generated = "\n".join(
        (layout.layout_text(plan.macros), layout.kinds_text("BSDF"), layout.kinds_text("PHASE"))
    )
    tables = {a.needs for a in layout.ARGUMENTS} | {
        m for f in layout.PATH_STATE for m in (*f.needs, f.unless, f.times)
    }
    used = set(re.findall(r"\bCLVOL_\w+", ALL + generated)) | tables
    unused = {name for name in plan.macros if name not in used and not name.startswith("CLVOL_SHOWS_")}
    assert not unused
    made = set(re.findall(r"#define (\w+)", ALL + generated)) | {
        *(f"CLVOL_{slot.upper()}_HEADER" for slot in plan.slots),
        *programs.SHARED,
    }
    unknown = {n for n in re.findall(r"\bCLVOL_\w+", ALL) if n not in plan.macros and n not in made}
    assert {n for n in unknown if not n.startswith("CLVOL_RAY_")} == {
        "CLVOL_BSDF_",  # pasted, as the next
        "CLVOL_PHASE_",
        "CLVOL_LAYOUT_HEADER",
        "CLVOL_CONTRACT_HEADER",
    }
