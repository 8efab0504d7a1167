"""The numbers of principled BSDFs, in the order in which `material_tables` has them."""

from __future__ import annotations

PRINCIPLED_NUMBERS = (
    *("roughness", "anisotropic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness"),
    *("metallic", "clearcoat", "clearcoat_gloss"),
    *("eta", "diff_trans"),
)
"""Parameters that are a number or a texture.  Each takes two floats: the number, and its texture or -1."""

PRINCIPLED_RATES = ("diffuse_rate", "specular_rate", "third_rate", "fourth_rate")
"""How often lobes are sampled, beside each other; of clearcoat the third, of the thin one's transmissions the
third (specular) and the fourth (diffuse)."""

PRINCIPLED = (*PRINCIPLED_NUMBERS, *PRINCIPLED_RATES)
"""All of them, on the device ``PRINCIPLED_ROUGHNESS`` and so on."""
