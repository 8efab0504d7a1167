"""BSDFs that bend the surface of another one: normal maps and bump maps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from clvol.scene.materials import Bitmap, Bsdf, BumpMap, NormalMap, VolumeTexture
from clvol.scene.sides import bsdf_parts
from clvol.scene.texture import texture

if TYPE_CHECKING:
    from clvol.scene.reader import Reader


def normalmap(reader: Reader) -> NormalMap:
    """The `normalmap` plugin: normals in the surface's frame, as colours (n + 1) / 2."""
    if not reader.has("normalmap"):
        reader.fail("a normalmap needs a normalmap, the texture of its normals")
    normals = texture(reader, "normalmap", 0.5)
    if isinstance(normals, VolumeTexture) and normals.volume.grid.channels != 3:
        reader.fail("a normalmap needs a volume of three channels, this one has one", "normalmap")
    return NormalMap(_nested(reader), normals, **_flags(reader))


def bumpmap(reader: Reader) -> Bsdf:
    """The `bumpmap` plugin: heights by the one texture in it, times `scale`."""
    scale, flags, nested = reader.number("scale", 1.0), _flags(reader), _nested(reader)
    found = reader.children("texture")
    if len(found) != 1:
        where = found[1][0] if found else ""
        reader.fail(f"a bumpmap takes one texture, of its heights, got {len(found)}", where)
    name, node = found[0]
    heights = reader.build(node)
    if not isinstance(heights, Bitmap):
        what = f"a '{node.type}' has no slope that bends a surface"
        reader.unsupported(what, name, "give a bitmap")
    return BumpMap(nested, heights, scale, **flags)


def _flags(reader: Reader) -> dict[str, Any]:
    return {name: reader.boolean(name, True) for name in ("flip_invalid_normals", "use_shadowing_function")}


def _nested(reader: Reader) -> Bsdf:
    found = reader.children("bsdf")
    if len(found) != 1:
        where = found[1][0] if found else ""
        reader.fail(f"a {reader.type} takes one BSDF, whose surface it bends, got {len(found)}", where)
    nested: Bsdf = reader.build(found[0][1])
    if any(side.bend is not None for side in bsdf_parts(nested)):
        reader.unsupported("a surface that is bent twice is not supported", found[0][0])
    return nested
