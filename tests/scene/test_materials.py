"""BSDFs as records and as the device's tables: reading, flattening, and what scenes are told by them."""

import numpy as np
import pytest
from material_probe import read

from clvol import layout, load_dict
from clvol.errors import SceneError
from clvol.scene import material_facts as facts
from clvol.scene.materials import (
    Blend,
    Conductor,
    Dielectric,
    Diffuse,
    Mask,
    Null,
    Plastic,
    Principled,
    PrincipledThin,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    TwoSided,
)
from clvol.scene.refraction import INDICES, METALS
from clvol.scene.sides import bsdf_parts
from clvol.tables.coat import coat_shares, diffuse_reflectance, fresnel
from clvol.tables.materials import BLACK, material_table

RED = {"type": "rgb", "value": [0.8, 0.4, 0.1]}
CHECKERS = {"type": "checkerboard"}
DIFFUSE = {"type": "diffuse"}
PICTURE = {"type": "bitmap", "bitmap": np.zeros((2, 2))}
BUMPS = {"type": "bumpmap", "a": DIFFUSE, "t": PICTURE}
BLEND = {"type": "blendbsdf", "weight": 0.25, "a": DIFFUSE, "b": {"type": "dielectric"}}


def rgb(*values):
    return {"type": "rgb", "value": list(values)}


# -- reading -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("plugin", "record"),
    [
        ("null", Null()),
        ("diffuse", Diffuse()),
        ("dielectric", Dielectric()),
        ("thindielectric", Dielectric(thin=True)),
        ("roughdielectric", RoughDielectric()),
        ("conductor", Conductor()),
        ("roughconductor", RoughConductor()),
        ("plastic", Plastic()),
        ("roughplastic", RoughPlastic()),
        ("principledthin", PrincipledThin()),
    ],
)
def test_defaults(plugin, record):
    found = read({"type": plugin})
    assert type(found) is type(record) and vars(found) == vars(record)


def test_principled():
    """Indices by `specular`, and those of a boundary that would be none."""
    found = read({"type": "principled"})
    assert vars(found) == vars(Principled()) | {"eta": pytest.approx(1.5)}
    assert facts.bsdf_kinds(found) == {"PRINCIPLED"} and not facts.is_transmissive(found)
    glass = read({"type": "principled", "spec_trans": CHECKERS, "eta": 1})
    assert glass.eta == 1.001 and facts.bsdf_kinds(glass) == {"PRINCIPLED_GLASS"}
    assert read({"type": "principled", "specular": 0, "spec_trans": 1.0}).eta > 1
    assert facts.has_textures(read({"type": "roughconductor", "alpha": CHECKERS}))
    metal = read({"type": "conductor", "eta": CHECKERS})
    assert facts.has_textures(metal) and facts.has_metal_textures(metal)
    assert facts.is_grey(metal) == facts.color_is_grey(metal.eta)
    assert not facts.has_metal_textures(read({"type": "conductor", "specular_reflectance": CHECKERS}))
    with pytest.raises(SceneError, match="light passes"):
        read({"type": "twosided", "inner": {"type": "principled", "spec_trans": 0.5}})


def test_parameters():
    found = read(
        {
            "type": "roughdielectric",
            "int_ior": "Water",
            "ext_ior": 1.2,
            "distribution": "ggx",
            "alpha_u": 0.2,
            "alpha_v": 0.3,
            "specular_reflectance": RED,
            "specular_transmittance": 0.5,
            "sample_visible": False,
        }
    )
    assert (found.int_ior, found.ext_ior, found.distribution) == (1.333, 1.2, "ggx")
    assert (found.alpha_u, found.alpha_v) == (0.2, 0.3)
    assert found.specular_reflectance == (0.8, 0.4, 0.1) and found.specular_transmittance == (0.5,)
    found = read({"type": "roughconductor", "material": "Cu", "alpha": 0.4})
    assert (found.eta, found.k) == METALS["Cu"] and found.alpha_u == found.alpha_v == 0.4
    spectrum = {"type": "spectrum", "value": [(400, 0.2), (500, 0.5), (600, 1.3), (700, 3.0)]}
    found = read({"type": "conductor", "eta": spectrum})  # against Mitsuba 3.9.1, and beyond 1
    assert np.allclose(found.eta, (1.83431, 0.81006, 0.283643), rtol=1e-4) and found.k == (1,)
    found = read({"type": "conductor", "eta": rgb(1, 2, 3), "k": 4.0})
    assert found.eta == (1, 2, 3) and found.k == (4,)
    found = read({"type": "roughplastic", "diffuse_reflectance": RED, "nonlinear": True, "alpha": 0.2})
    assert found.nonlinear and found.diffuse_reflectance == (0.8, 0.4, 0.1) and found.alpha == 0.2


def test_wrappers_hold_others():
    one = read({"type": "twosided", "a": DIFFUSE})
    assert one.front is one.back
    two = read({"type": "twosided", "z": DIFFUSE, "a": {"type": "plastic"}})
    assert isinstance(two.front, Diffuse) and isinstance(two.back, Plastic)
    mask = read({"type": "mask", "opacity": CHECKERS, "nested": {"type": "twosided", "a": DIFFUSE}})
    assert isinstance(mask, Mask) and isinstance(mask.nested, TwoSided)
    assert read({"type": "mask", "nested": DIFFUSE}).opacity == (0.5,)


def test_names_of_indices_and_metals():
    assert len(INDICES) == 23 and INDICES["bk7"] == 1.5046 and INDICES["diamond"] == 2.419
    assert METALS["Au"] == ((0.143036, 0.375307, 1.44205), (3.983, 2.38556, 1.60336))
    assert METALS["Al"][1][0] > 9 and len(METALS) == 71
    assert METALS["TiO2_palik"] is not METALS["TiO2-e_palik"] and METALS["TiO2_palik"] == METALS["TiO2"]


@pytest.mark.parametrize(
    ("description", "message"),
    [
        (DIFFUSE | {"reflectance": 1.5}, r"'reflectance' of bsdf 'diffuse' must be in \[0, 1\]"),
        (DIFFUSE | {"reflectance": rgb(0.5, -0.1, 0)}, r"in \[0, 1\]"),
        (DIFFUSE | {"reflectance": DIFFUSE}, "a spectrum or a texture, got a 'diffuse'"),
        (DIFFUSE | {"color": 0.5}, "unknown parameter 'color'"),
        (DIFFUSE | {"inner": DIFFUSE}, "takes no bsdf"),
        ({"type": "dielectric", "int_ior": "bk8"}, "unknown material 'bk8'"),
        ({"type": "dielectric", "int_ior": 0.0}, "> 0"),
        ({"type": "dielectric", "ext_ior": -1.0}, "> 0"),
        ({"type": "dielectric", "alpha": 0.1}, "unknown parameter 'alpha'"),
        ({"type": "roughdielectric", "int_ior": "air"}, "must differ"),
        ({"type": "roughplastic", "int_ior": 1.5, "ext_ior": 1.5}, "must differ"),
        ({"type": "roughdielectric", "alpha_u": 0.1}, "both alpha_u and alpha_v"),
        ({"type": "roughconductor", "alpha": 0.1, "alpha_u": 0.1, "alpha_v": 0.1}, "either alpha"),
        ({"type": "roughconductor", "alpha": -0.1}, ">= 0"),
        ({"type": "roughplastic", "alpha": CHECKERS}, "a number"),
        ({"type": "roughplastic", "alpha_u": 0.1}, "unknown parameter 'alpha_u'"),
        ({"type": "roughconductor", "distribution": "phong"}, "cannot be 'phong'"),
        ({"type": "conductor", "material": "au"}, "unknown metal 'au'; did you mean 'Au'"),
        ({"type": "conductor", "material": "Gold"}, "did you mean 'Au'"),
        ({"type": "conductor", "material": "TIO2"}, "did you mean 'TiO2' or 'TiO2-e'"),
        ({"type": "roughconductor", "material": "Cu3"}, r"did you mean .*'Cu'.* or .*\?"),
        ({"type": "dielectric", "int_ior": "Wter"}, "did you mean 'water'"),
        ({"type": "conductor", "material": "Au", "k": 1.0}, "either a material or eta and k"),
        ({"type": "conductor", "eta": DIFFUSE}, "a spectrum or a texture, got a 'diffuse'"),
        ({"type": "plastic", "nonlinear": 1}, "true or false"),
        ({"type": "twosided"}, "no BSDF in it"),
        ({"type": "twosided", "a": DIFFUSE, "b": DIFFUSE, "c": DIFFUSE}, "at most 2 BSDFs, got 3"),
        ({"type": "twosided", "a": {"type": "dielectric"}}, "takes no BSDF that light passes"),
        ({"type": "twosided", "a": {"type": "mask", "b": DIFFUSE}}, "takes no BSDF that light passes"),
        ({"type": "mask", "opacity": 0.5}, "no BSDF in it"),
        ({"type": "mask", "opacity": 1.5, "a": DIFFUSE}, r"in \[0, 1\]"),
        ({"type": "mask", "a": DIFFUSE, "b": DIFFUSE}, "at most 1 BSDFs, got 2"),
        ({"type": "blendbsdf", "a": DIFFUSE, "b": DIFFUSE}, "needs a weight"),
        (BLEND | {"weight": np.nan}, "finite"),
        (BLEND | {"weight": rgb(0, 0.5, 1.5)}, r"in \[0, 1\]"),
        (BLEND | {"weight": DIFFUSE}, "a spectrum or a texture, got a 'diffuse'"),
        ({"type": "blendbsdf", "weight": 0.5, "a": DIFFUSE}, "takes two BSDFs, got 1"),
        (BLEND | {"c": DIFFUSE}, "at most 2 BSDFs, got 3"),
        ({"type": "twosided", "a": BLEND | {"b": {"type": "null"}}}, "takes no BSDF that light passes"),
        ({"type": "twosided", "a": BLEND}, "takes no BSDF that light passes"),
        ({"type": "bumpmap", "a": DIFFUSE}, "takes one texture, of its heights, got 0"),
        (BUMPS | {"other": PICTURE}, "takes one texture, of its heights, got 2"),
        (BUMPS | {"b": DIFFUSE}, "takes one BSDF, whose surface it bends, got 2"),
        (BUMPS | {"t": CHECKERS}, "a 'checkerboard' has no slope"),
        (BUMPS | {"scale": np.inf}, "finite"),
        (BUMPS | {"a": BUMPS}, "bent twice"),
        ({"type": "normalmap", "a": DIFFUSE}, "needs a normalmap"),
        ({"type": "normalmap", "normalmap": rgb(0, 2, 0), "a": DIFFUSE}, r"in \[0, 1\]"),
        ({"type": "normalmap", "normalmap": rgb(0, 1, 0)}, "takes one BSDF, whose surface it bends, got 0"),
        ({"type": "measured"}, "not supported in this version"),
        ({"type": "principled", "eta": 1.5, "specular": 0.5}, "either eta or specular"),
        ({"type": "principled", "specular": 12.5}, "must be"),
        ({"type": "principled", "metallic": 1.5}, "must be"),
        ({"type": "principledthin", "diff_trans": 2.5}, "must be"),
    ],
)
def test_errors(description, message):
    with pytest.raises(SceneError, match=message) as caught:
        read(description)
    assert caught.value.where


# -- tables ------------------------------------------------------------------------------------------


def table_of(*descriptions):
    return material_table([read(description) for description in descriptions])


def kinds(table):
    return [layout.BSDFS[kind] for kind in table.materials["kind"]]


def test_sides():
    table = table_of(
        {"type": "null"},
        {"type": "null"},
        DIFFUSE,
        {"type": "dielectric"},
        {"type": "twosided", "a": DIFFUSE},
        {"type": "twosided", "a": DIFFUSE, "b": {"type": "conductor"}},
        {"type": "mask", "opacity": 0.3, "a": {"type": "twosided", "b": DIFFUSE}},
        {"type": "mask", "opacity": 0.3, "a": {"type": "thindielectric"}},
        {"type": "mask", "opacity": 0.3, "a": {"type": "null"}},
        {"type": "mask", "opacity": 1.0, "a": DIFFUSE},
    )
    assert table.sides.tolist() == [
        *([0, 0], [0, 0], [1, BLACK], [2, 2], [3, 3], [4, 5], [6, 6], [7, 7], [0, 0], [8, BLACK])
    ]
    names = "NULL DIFFUSE DIELECTRIC DIFFUSE DIFFUSE CONDUCTOR DIFFUSE THIN_DIELECTRIC DIFFUSE"
    assert kinds(table) == names.split()
    assert np.allclose(table.materials["opacity"], [1, 1, 1, 1, 1, 1, 0.3, 0.3, 1])


def test_the_back_of_a_masked_front_is_black_and_masked():
    metal = {"type": "mask", "opacity": rgb(0.1, 0.2, 0.6), "a": {"type": "conductor"}}
    table = table_of({"type": "mask", "opacity": 0.5, "a": metal})
    assert table.sides.tolist() == [[0, 1]] and kinds(table) == ["CONDUCTOR", "CONDUCTOR"]
    assert np.allclose(table.materials["opacity"], 0.5 * 0.3)
    assert table.materials["specular"].tolist() == [[1, 1, 1], [0, 0, 0]]


def test_mixtures_are_lists_of_parts():
    inner = BLEND | {"weight": CHECKERS, "b": {"type": "conductor"}}
    glass = {"type": "dielectric"}
    table = table_of({"type": "blendbsdf", "weight": 0.25, "a": inner, "b": glass}, BLEND | {"weight": 0.0})
    assert table.sides.tolist() == [[3, 4], [5, BLACK]]
    assert kinds(table) == ["DIFFUSE", "CONDUCTOR", "DIELECTRIC", "BLEND", "BLEND", "DIFFUSE"]
    front, back = np.split(table.tables, [table.materials["table"][4]])
    assert front.tolist() == [3, 0, 0.75, 1, -1, 1, 0.75, 1, 0, 2, 0.25, 0]
    assert back.tolist() == [2, BLACK, 0.75, 0, 2, 0.25, 0]  # opaque ones are black from behind


def test_shares_are_cut_as_in_mitsuba():
    for given, used in ((1.5, 1.0), (-0.5, 0.0)):
        ball = {"type": "sphere", "bsdf": BLEND | {"weight": given}}
        scene = load_dict({"type": "scene", "camera": {"type": "perspective"}, "ball": ball})
        assert scene.shapes[0].bsdf.weight == (used,)
        assert "nearest number from 0 to 1" in scene.approximated[0]


def test_mixtures_of_mixtures_are_bounded():
    found = BLEND
    for _ in range(5):
        found = {"type": "blendbsdf", "weight": 0.5, "a": found, "b": found}
    assert len(bsdf_parts(read(found))) == 64
    with pytest.raises(SceneError, match="at most 64 BSDFs, got 128"):
        read({"type": "blendbsdf", "weight": 0.5, "a": found, "b": found})


def test_bent_surfaces_are_materials_that_name_others():
    both = {"type": "twosided", "b": DIFFUSE}
    board = rgb(0.25, 0.5, 1)
    table = table_of(
        {"type": "normalmap", "normalmap": board, "a": both},
        {"type": "twosided", "a": BUMPS | {"scale": 3.0, "flip_invalid_normals": False}},
        {
            "type": "normalmap",
            "normalmap": board,
            "a": {"type": "dielectric"},
            "use_shadowing_function": False,
        },
    )
    assert table.sides.tolist() == [[1, 2], [4, 4], [6, 6]]  # the back of a map round both sides is mirrored
    assert kinds(table) == ["DIFFUSE", "BENT", "BENT", "DIFFUSE", "BENT", "DIELECTRIC", "BENT"]
    entries = table.tables.reshape(-1, 7).tolist()
    assert entries[:2] == [[0, 0, 0, 1, 1, 1, 0], [0, 0, 0, 1, 1, 1, 1]]
    assert entries[2:] == [[3, 1, 1, 3, 0, 1, 0], [5, 0, 0, 1, 1, 0, 0]]
    assert table_of(BUMPS | {"a": {"type": "null"}}).sides.tolist() == [[0, 0]]


def test_each_object_once():
    shared = read(DIFFUSE)
    table = material_table([shared, TwoSided(shared, shared), shared, Diffuse()])
    assert table.sides.tolist() == [[0, BLACK], [0, 0], [0, BLACK], [1, BLACK]]
    assert len(material_table([]).materials) == 0


def test_numbers_of_a_record():
    table = table_of(
        {"type": "roughconductor", "eta": rgb(1, 2, 3), "k": 4.0, "alpha": 0.0, "distribution": "ggx"},
        {"type": "roughdielectric", "int_ior": 1.5, "ext_ior": 1.2, "alpha_u": 0.2, "alpha_v": 0.3},
        {"type": "plastic", "diffuse_reflectance": rgb(0.2, 0.4, 0.6), "specular_reflectance": 0.8},
        {"type": "roughplastic", "alpha": 0.1},
        {"type": "roughplastic", "alpha": 0.3, "specular_reflectance": 0.0, "diffuse_reflectance": 0.0},
    )
    metal, glass, plastic, first, second = table.materials
    assert metal["eta"].tolist() == [1, 2, 3] and metal["k"].tolist() == [4, 4, 4]
    assert np.isclose(metal["alpha_u"], 1e-4) and metal["distribution"] == 1
    assert np.isclose(glass["ior"], 1.25) and np.allclose([glass["alpha_u"], glass["alpha_v"]], [0.2, 0.3])
    assert glass["specular_texture"] == glass["transmittance_texture"] == glass["opacity_texture"] == -1
    assert np.isclose(plastic["specular_weight"], 0.8 / 1.2) and second["specular_weight"] == 0.5
    assert first["table"] == 0 and second["table"] == 64 and table.tables.shape == (128,)
    assert (np.diff(table.tables[:64]) > -1e-3).all() and 0 < table.tables[0] < table.tables[63] < 1


def test_records_that_no_loader_makes_are_refused():
    with pytest.raises(ValueError, match="two-sided"):
        material_table([TwoSided(Dielectric(), Diffuse())])
    with pytest.raises(ValueError, match="two-sided"):
        material_table([TwoSided(Blend(Diffuse(), Null()), Diffuse())])


def test_masks_of_two_textures_are_mixtures_with_nothing():
    table = material_table([Mask(Mask(Diffuse(), read(CHECKERS)), read(CHECKERS))])
    assert table.sides.tolist() == [[2, 4]]
    assert kinds(table) == ["NULL", "DIFFUSE", "BLEND", "DIFFUSE", "BLEND"]


# -- coats -------------------------------------------------------------------------------------------


def test_fits_of_diffuse_reflectance():
    """Within 0.2 % of light, of the integral of 2 F cos over the cosine."""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    cosine = 0.5 + 0.5 * nodes
    for ior in (1 / 2.4, 1 / 1.5, 1 / 1.1, 1.1, 1.5, 2.4):
        exact = weights @ (fresnel(cosine, ior) * cosine)
        assert abs(diffuse_reflectance(ior) - exact) < 2e-3 * (2.4 if ior < 0.5 else 1)


@pytest.mark.parametrize("distribution", ["beckmann", "ggx"])
def test_almost_smooth_coats_share_like_smooth_ones(distribution):
    reflected, refracted = coat_shares(distribution, 0.001, 1.5)
    cosine = np.linspace(0, 1, 64)
    assert np.allclose(reflected[3:], fresnel(cosine, 1.5)[3:], atol=2e-3)
    assert np.allclose((reflected + refracted)[3:], 1, atol=2e-3)
    rough = coat_shares(distribution, 0.5, 1.5)
    assert (sum(rough) < 1.001).all() and sum(rough)[32] < 0.99


# -- what scenes are told ----------------------------------------------------------------------------


def test_facts():
    bsdfs = {
        name: read(description)
        for name, description in {
            "null": {"type": "null"},
            "diffuse": DIFFUSE,
            "red": DIFFUSE | {"reflectance": RED},
            "gold": {"type": "conductor", "material": "Au"},
            "pane": {"type": "thindielectric"},
            "ice": {"type": "roughdielectric"},
            "both": {"type": "twosided", "a": {"type": "plastic"}, "b": {"type": "roughplastic"}},
            "holes": {"type": "mask", "opacity": CHECKERS, "a": {"type": "conductor"}},
            "picture": DIFFUSE | {"reflectance": {"type": "bitmap", "bitmap": np.eye(2)}},
            "colours": DIFFUSE
            | {"reflectance": {"type": "bitmap", "bitmap": np.ones((1, 1, 3)) * [0, 1, 0]}},
        }.items()
    }

    def where(fact):
        return {name for name, bsdf in bsdfs.items() if fact(bsdf)}

    assert facts.bsdf_kinds(bsdfs["both"]) == {"PLASTIC", "ROUGH_PLASTIC"}
    assert facts.bsdf_kinds(bsdfs["holes"]) == {"CONDUCTOR"}
    assert where(facts.is_grey) == set(bsdfs) - {"red", "gold", "colours"}
    assert where(facts.passes_light) == {"null", "pane", "holes"}
    assert where(facts.is_transmissive) == {"ice"}
    assert where(facts.reflects) == set(bsdfs) - {"null"}
    assert where(facts.samples_lights) == {"diffuse", "red", "ice", "both", "picture", "colours"}
    assert where(facts.has_textures) == {"holes", "picture", "colours"}
    assert where(facts.has_bitmaps) == {"picture", "colours"}
    assert where(facts.has_tables) == {"both"}


def test_every_kind_has_a_file_that_compiles_alone(device):
    """Only the headers of the kinds that a scene has are there, and no texture."""
    import pyopencl as cl
    from material_probe import source

    from clvol.device.programs import BUILD_OPTIONS

    for kind in layout.BSDFS:
        program = cl.Program(device.context, source({kind}, channel=0, textures=False)).build(
            list(BUILD_OPTIONS)
        )
        assert {"sample_probe", "value_probe"} <= {k.function_name for k in program.all_kernels()}
