"""What Mitsuba 3.9.1 (variant scalar_rgb) says of some BSDFs; read by test_bsdf.py.

Made once with ``b = mi.load_dict(BSDFS[name])`` and a SurfaceInteraction3f of that wi: VALUES are ``b.eval``
and ``b.pdf`` (where either is not 0) for PAIRS of wi and wo, normalised; DELTAS are wo, weight and eta of
``b.sample`` for INCIDENT wi, with sample1 1e-6 and 1 - 1e-6, sample2 (0.3, 0.4), where the lobe is a delta.
"""

import numpy as np


def _rgb(*values):
    return {"type": "rgb", "value": list(values)}


RED, TINT = _rgb(0.8, 0.4, 0.1), _rgb(0.9, 0.7, 0.5)
BSDFS = {
    "diffuse": {"type": "diffuse", "reflectance": RED},
    "dielectric": {"type": "dielectric", "specular_transmittance": TINT},
    "bubble": {"type": "dielectric", "int_ior": "air", "ext_ior": "water", "specular_reflectance": TINT},
    "thindielectric": {
        "type": "thindielectric",
        "int_ior": "diamond",
        "specular_transmittance": TINT,
        "specular_reflectance": RED,
    },
    "conductor": {"type": "conductor", "material": "Au", "specular_reflectance": TINT},
    "mirror": {"type": "conductor"},
    "chrome": {"type": "roughconductor", "material": "Cr", "alpha": 0.3},
    "ggx metal": {
        "type": "roughconductor",
        "eta": _rgb(0.2, 1.1, 2.0),
        "k": _rgb(3.0, 2.0, 0.5),
        "distribution": "ggx",
        "alpha_u": 0.2,
        "alpha_v": 0.6,
        "specular_reflectance": TINT,
    },
    "roughdielectric": {"type": "roughdielectric", "alpha": 0.3, "specular_transmittance": TINT},
    "ggx ice": {
        "type": "roughdielectric",
        "distribution": "ggx",
        "int_ior": "water ice",
        "alpha_u": 0.5,
        "alpha_v": 0.25,
    },
    "rough bubble": {"type": "roughdielectric", "int_ior": 1.0, "ext_ior": 1.5, "alpha": 0.4},
    "plastic": {"type": "plastic", "diffuse_reflectance": RED},
    "nonlinear plastic": {
        "type": "plastic",
        "diffuse_reflectance": RED,
        "nonlinear": True,
        "int_ior": 1.9,
        "specular_reflectance": TINT,
    },
    "roughplastic": {"type": "roughplastic", "diffuse_reflectance": RED, "alpha": 0.2},
    "ggx plastic": {
        "type": "roughplastic",
        "distribution": "ggx",
        "diffuse_reflectance": RED,
        "nonlinear": True,
        "int_ior": "amber",
        "alpha": 0.4,
        "specular_reflectance": TINT,
    },
    "principled": {
        "type": "principled",
        "base_color": RED,
        "roughness": 0.4,
        "anisotropic": 0.5,
        "metallic": 0.3,
        "spec_tint": 0.4,
        "sheen": 0.6,
        "sheen_tint": 0.7,
        "flatness": 0.3,
        "clearcoat": 0.8,
        "clearcoat_gloss": 0.2,
        "specular": 0.7,
    },
    "principled glass": {
        "type": "principled",
        "base_color": TINT,
        "roughness": 0.5,
        "metallic": 0.1,
        "spec_trans": 0.8,
        "eta": 1.4,
        "spec_tint": 0.5,
        "clearcoat": 0.3,
        "main_specular_sampling_rate": 0.7,
    },
    "principled sheet": {
        "type": "principledthin",
        "base_color": RED,
        "roughness": 0.6,
        "anisotropic": 0.4,
        "spec_trans": 0.5,
        "spec_tint": 0.3,
        "sheen": 0.5,
        "sheen_tint": 0.2,
        "flatness": 0.4,
        "diff_trans": 0.8,
        "eta": 1.4,
        "diffuse_reflectance_sampling_rate": 0.6,
    },
}


def _unit(vectors):
    vectors = np.array(vectors)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


PAIRS = _unit(
    [
        ((0.5, 0.2, 0.6), (-0.4, -0.3, 0.7)),
        ((0.5, 0.2, 0.6), (-0.55, -0.15, 0.6)),
        ((-0.9, 0.3, 0.15), (0.9, -0.2, 0.2)),
        ((0.1, 0.0, 1.0), (-0.15, 0.05, 1.0)),
        ((0.3, 0.4, 0.2), (0.5, -0.2, 0.3)),
        ((0.5, 0.2, 0.6), (-0.4, -0.3, -0.7)),
        ((0.5, 0.2, 0.6), (-0.3, -0.15, -0.6)),
        ((0.2, -0.5, -0.9), (-0.3, 0.6, -0.7)),
        ((0.2, -0.5, -0.9), (-0.4, 0.8, 0.5)),
    ]
)
INCIDENT = _unit([(0.5, 0.2, 0.6), (-0.9, 0.3, 0.15), (0.2, -0.5, -0.9), (0.9, -0.3, -0.15)])

_VALUES = """
diffuse, 0, 0.207216 0.103608 0.0259019 0.259019
diffuse, 1, 0.184606 0.0923031 0.0230758 0.230758
diffuse, 2, 0.0539852 0.0269926 0.00674816 0.0674816
diffuse, 3, 0.251523 0.125762 0.0314404 0.314404
diffuse, 4, 0.123928 0.061964 0.015491 0.15491
chrome, 0, 0.713641 0.67392 0.714127 1.04469
chrome, 1, 0.786857 0.743266 0.788247 1.15625
chrome, 2, 1.27472 1.30532 1.48859 2.37685
chrome, 3, 0.604191 0.570371 0.60367 0.87876
chrome, 4, 8.91796e-13 8.42014e-13 8.91748e-13 1.30178e-12
ggx metal, 0, 0.462528 0.187185 0.039245 0.568069
ggx metal, 1, 0.681926 0.277259 0.0593688 0.833447
ggx metal, 2, 1.4217 0.781555 0.352674 2.08906
ggx metal, 3, 0.536733 0.215571 0.0436412 0.646153
ggx metal, 4, 0.00361506 0.00145806 0.000300954 0.00463059
roughdielectric, 0, 0.0472599 0.0472599 0.0472599 0.04726
roughdielectric, 1, 0.0559615 0.0559615 0.0559615 0.0559615
roughdielectric, 2, 0.78216 0.78216 0.78216 0.844935
roughdielectric, 3, 0.0356255 0.0356255 0.0356255 0.0356255
roughdielectric, 4, 5.60319e-14 5.60319e-14 5.60319e-14 5.60318e-14
roughdielectric, 5, 0.354289 0.275558 0.196827 0.890669
roughdielectric, 6, 7.38839 5.74652 4.10466 18.5741
roughdielectric, 7, 0.115554 0.115554 0.115554 0.115554
roughdielectric, 8, 2.56358 1.9939 1.42421 1.25893
ggx ice, 0, 0.0141964 0.0141964 0.0141964 0.0145196
ggx ice, 1, 0.016995 0.016995 0.016995 0.0178601
ggx ice, 2, 0.0820481 0.0820481 0.0820481 0.142553
ggx ice, 3, 0.0112263 0.0112263 0.0112263 0.0112425
ggx ice, 4, 0.00157878 0.00157878 0.00157878 0.00182533
ggx ice, 5, 0.457214 0.457214 0.457214 0.802039
ggx ice, 6, 7.93973 7.93973 7.93973 13.8403
ggx ice, 7, 0.0192262 0.0192262 0.0192262 0.0196579
ggx ice, 8, 0.257703 0.257703 0.257703 0.161438
rough bubble, 0, 0.0963262 0.0963262 0.0963262 0.0963262
rough bubble, 1, 0.659887 0.659887 0.659887 0.659887
rough bubble, 2, 1.47751 1.47751 1.47751 1.72795
rough bubble, 3, 0.019901 0.019901 0.019901 0.019901
rough bubble, 4, 3.8347e-08 3.8347e-08 3.8347e-08 3.84085e-08
rough bubble, 5, 6.18631e-05 6.18631e-05 6.18631e-05 2.74947e-05
rough bubble, 6, 2.2151e-10 2.2151e-10 2.2151e-10 9.84489e-11
rough bubble, 7, 0.0241133 0.0241133 0.0241133 0.0241133
plastic, 0, 0.208485 0.104242 0.0260606 0.233206
plastic, 1, 0.184703 0.0923516 0.0230879 0.207761
plastic, 2, 0.0234224 0.0117112 0.0029278 0.0250883
plastic, 3, 0.255804 0.127902 0.0319755 0.287695
plastic, 4, 0.105512 0.0527559 0.013189 0.110568
nonlinear plastic, 0, 0.118898 0.0333077 0.00626182 0.217878
nonlinear plastic, 1, 0.105202 0.0294712 0.00554056 0.194105
nonlinear plastic, 2, 0.0133305 0.00373436 0.000702057 0.028589
nonlinear plastic, 3, 0.146316 0.0409886 0.00770583 0.268259
nonlinear plastic, 4, 0.0593495 0.0166261 0.00312568 0.109069
roughplastic, 0, 0.274701 0.179178 0.107536 0.434415
roughplastic, 1, 0.284846 0.200328 0.136939 0.468171
roughplastic, 2, 0.744266 0.730058 0.719402 1.06174
roughplastic, 3, 0.310556 0.19287 0.104606 0.4531
roughplastic, 4, 0.0964198 0.0482099 0.0120525 0.110466
ggx plastic, 0, 0.129358 0.0626334 0.0236314 0.299472
ggx plastic, 1, 0.121087 0.06082 0.0249035 0.283679
ggx plastic, 2, 0.208643 0.156011 0.107954 0.397297
ggx plastic, 3, 0.152751 0.0704703 0.0234727 0.331038
ggx plastic, 4, 0.053545 0.0227402 0.00573588 0.126474
principled, 0, 0.701696 0.385034 0.147538 1.18218
principled, 1, 1.05621 0.589933 0.240223 1.93505
principled, 2, 0.284439 0.215186 0.163247 0.36199
principled, 3, 1.03549 0.583067 0.24375 1.80824
principled, 4, 0.103565 0.0521944 0.0136664 0.069979
principled glass, 0, 0.186619 0.150405 0.114192 0.377237
principled glass, 1, 0.234571 0.190516 0.146461 0.5304
principled glass, 2, 0.44248 0.424653 0.406826 0.605221
principled glass, 3, 0.214484 0.174265 0.134046 0.451318
principled glass, 4, 0.0283418 0.0221323 0.0159228 0.0351231
principled glass, 5, 0.579751 0.511292 0.432121 0.884896
principled glass, 6, 8.63135 7.61214 6.43343 13.1345
principled glass, 7, 0.0462074 0.0462074 0.0462074 0.065085
principled glass, 8, 0.745594 0.657552 0.555733 0.583498
principled sheet, 0, 0.0695258 0.038499 0.0152289 0.245476
principled sheet, 1, 0.0663431 0.0376728 0.0161701 0.261933
principled sheet, 2, 0.0981949 0.0863185 0.0774113 0.194787
principled sheet, 3, 0.0745341 0.0402076 0.0144627 0.236343
principled sheet, 4, 0.0452108 0.0229558 0.00626463 0.0529875
principled sheet, 5, 0.863783 0.431891 0.107973 0.663266
principled sheet, 6, 1.20799 0.603994 0.150998 0.916718
principled sheet, 7, 0.0608223 0.033516 0.0130363 0.210503
principled sheet, 8, 0.0706102 0.0353051 0.00882627 0.069344
"""
_DELTAS = """
dielectric, 0, -0.620174 -0.248069 0.744208 1 1 1 1
dielectric, 1, -0.412299 -0.16492 -0.895997 0.397778 0.309383 0.220988 1.50418
dielectric, 2, 0.937043 -0.312348 0.156174 1 1 1 1
dielectric, 3, 0.622958 -0.207653 -0.754191 0.397778 0.309383 0.220988 1.50418
dielectric, 4, -0.190693 0.476731 -0.858116 1 1 1 1
dielectric, 5, -0.286837 0.717091 0.63522 2.03631 1.5838 1.13128 0.664813
dielectric, 6, -0.937043 0.312348 -0.156174 1 1 1 1
dielectric, 7, -0.937043 0.312348 -0.156174 1 1 1 1
bubble, 0, -0.620174 -0.248069 0.744208 0.9 0.7 0.5 1
bubble, 1, -0.826463 -0.330585 -0.455712 1.7759 1.7759 1.7759 0.750395
bubble, 2, 0.937043 -0.312348 0.156174 0.9 0.7 0.5 1
bubble, 3, 0.937043 -0.312348 0.156174 0.9 0.7 0.5 1
bubble, 4, -0.190693 0.476731 -0.858116 0.9 0.7 0.5 1
bubble, 5, -0.143095 0.357737 0.922794 0.563093 0.563093 0.563093 1.33263
bubble, 6, -0.937043 0.312348 -0.156174 0.9 0.7 0.5 1
bubble, 7, -0.703152 0.234384 0.671298 0.563093 0.563093 0.563093 1.33263
thindielectric, 0, -0.620174 -0.248069 0.744208 0.8 0.4 0.1 1
thindielectric, 1, -0.620174 -0.248069 -0.744208 0.9 0.7 0.5 1
thindielectric, 2, 0.937043 -0.312348 0.156174 0.8 0.4 0.1 1
thindielectric, 3, 0.937043 -0.312348 -0.156174 0.9 0.7 0.5 1
thindielectric, 4, -0.190693 0.476731 -0.858116 0.8 0.4 0.1 1
thindielectric, 5, -0.190693 0.476731 0.858116 0.9 0.7 0.5 1
thindielectric, 6, -0.937043 0.312348 -0.156174 0.8 0.4 0.1 1
thindielectric, 7, -0.937043 0.312348 0.156174 0.9 0.7 0.5 1
conductor, 0, -0.620174 -0.248069 0.744208 0.869082 0.560707 0.166362 1
conductor, 1, -0.620174 -0.248069 0.744208 0.869082 0.560707 0.166362 1
conductor, 2, 0.937043 -0.312348 0.156174 0.868432 0.619307 0.308718 1
conductor, 3, 0.937043 -0.312348 0.156174 0.868432 0.619307 0.308718 1
mirror, 0, -0.620174 -0.248069 0.744208 1 1 1 1
mirror, 1, -0.620174 -0.248069 0.744208 1 1 1 1
mirror, 2, 0.937043 -0.312348 0.156174 1 1 1 1
mirror, 3, 0.937043 -0.312348 0.156174 1 1 1 1
plastic, 0, -0.620174 -0.248069 0.744208 0.45927 0.45927 0.45927 1
plastic, 2, 0.937043 -0.312348 0.156174 0.672869 0.672869 0.672869 1
nonlinear plastic, 0, -0.620174 -0.248069 0.744208 0.593026 0.461243 0.329459 1
nonlinear plastic, 2, 0.937043 -0.312348 0.156174 0.713883 0.555242 0.396601 1
"""


def _read(text):
    table = {name: {} for name in BSDFS}
    for line in text.strip().splitlines():
        name, number, values = line.split(", ")
        table[name][int(number)] = np.array(values.split(), float)
    return table


VALUES = _read(_VALUES)
"""Name -> number of a pair -> value (3) and pdf; both 0 for other pairs."""
DELTAS = _read(_DELTAS)
"""Name -> 2 · number of an incident direction, + 1 for the second sample1 -> wo (3), weight (3) and eta."""
