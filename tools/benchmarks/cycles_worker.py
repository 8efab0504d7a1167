"""Renders with Blender's Cycles on request; tools/bench.py runs it in an environment that has `bpy` 5.

Reads one JSON object a line and answers each with one:

    {"load": "scene.json", "res": 128, "threads": 2}  ->  {"version": "5.0.1", "cpu": 0.3, "wall": 0.3}
    {"spp": 64, "seed": 1, "image": "out.npy"}        ->  {"cpu": 3.1, "wall": 1.6}

scene.json and the volumes beside it are what `benchmarks.scenes.write_scene` writes.  Everything that trades
bias for speed is off: clamping, light thresholds, adaptive sampling, denoising, biased volume stepping.
"""

from __future__ import annotations

import argparse
import glob
import json
import os
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

MOST_BOUNCES = 1024
VOL_HEADER = 48
"""Bytes of a .vol file before its voxels."""


def read_vol(path: Path) -> np.ndarray:
    """The voxels of a .vol file, float32 [z, y, x, channel]."""
    data = path.read_bytes()
    x, y, z, channels = np.frombuffer(data, "<i4", 4, offset=8)
    return np.frombuffer(data, "<f4", offset=VOL_HEADER).reshape(z, y, x, channels)


class Cycles:
    """One scene in Blender."""

    def __init__(self, path: Path, res: int, threads: int) -> None:
        import bpy

        packages = Path(bpy.utils.resource_path("LOCAL"), "python", "lib", "python3*", "site-packages")
        sys.path += glob.glob(str(packages))
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.bpy, self.folder, self.res = bpy, path.parent, res
        self.described = json.loads(path.read_text(encoding="utf-8"))
        self.scene = bpy.context.scene
        self._set_renderer(threads)
        self._add_camera()
        self._add_lights()
        self._add_volume()
        for number, quad in enumerate(self.described["quads"]):
            self._add_quad(f"quad{number}", quad)

    def _link(self, name: str, data: Any) -> Any:
        made = self.bpy.data.objects.new(name, data)
        self.scene.collection.objects.link(made)
        return made

    def _set_renderer(self, threads: int) -> None:
        scene, cycles, described = self.scene, self.scene.cycles, self.described
        scene.render.engine = "CYCLES"
        scene.render.threads_mode, scene.render.threads = "FIXED", threads
        scene.render.use_persistent_data = True
        scene.render.resolution_x = scene.render.resolution_y = self.res
        scene.render.resolution_percentage = 100
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.render.image_settings.color_depth = "32"
        scene.view_settings.view_transform = "Raw"
        bounces = min(described["scatterings"], MOST_BOUNCES)
        roulette = min(described["roulette"], MOST_BOUNCES)
        settings = {
            "device": "CPU",
            "use_adaptive_sampling": False,
            "use_denoising": False,
            "use_light_tree": False,
            "use_guiding": False,
            "use_fast_gi": False,
            "volume_biased": False,
            "sample_clamp_direct": 0,
            "sample_clamp_indirect": 0,
            "blur_glossy": 0,
            "light_sampling_threshold": 0,
            "pixel_filter_type": "BOX",
            "filter_width": 1.0,
            "transparent_max_bounces": MOST_BOUNCES,
            "min_light_bounces": roulette,
            "min_transparent_bounces": MOST_BOUNCES,
            "sampling_pattern": "TABULATED_SOBOL",
            "auto_scrambling_distance": False,
            "scrambling_distance": 1.0,
        }
        kinds = ("max", "diffuse", "glossy", "transmission", "volume")
        for name, value in {**settings, **{f"{kind}_bounces": bounces for kind in kinds}}.items():
            setattr(cycles, name, value)

    def _add_camera(self) -> None:
        from mathutils import Matrix, Vector

        eye, target, up = Vector(self.described["eye"]), Vector((0.5, 0.5, 0.5)), Vector((0, 1, 0))
        z = (eye - target).normalized()
        x = up.cross(z).normalized()
        y = z.cross(x)
        camera = self.bpy.data.cameras.new("camera")
        camera.sensor_fit, camera.angle = "HORIZONTAL", np.radians(40)
        camera.clip_start, camera.clip_end = 1e-3, 1e4
        self.scene.camera = self._link("camera", camera)
        rows = [(x[axis], y[axis], z[axis], eye[axis]) for axis in range(3)]
        self.scene.camera.matrix_world = Matrix((*rows, (0, 0, 0, 1)))

    def _add_lights(self) -> None:
        from mathutils import Vector

        world = self.scene.world = self.bpy.data.worlds.new("world")
        world.use_nodes = True
        [background] = (node for node in world.node_tree.nodes if node.type == "BACKGROUND")
        background.inputs["Color"].default_value = (*(self.described["sky"] or (0, 0, 0)), 1)
        background.inputs["Strength"].default_value = 1
        if self.described["sun"]:
            sun = self.bpy.data.lights.new("sun", "SUN")
            sun.angle, sun.energy, sun.color = 0, self.described["sun"]["irradiance"][0], (1, 1, 1)
            placed, towards = self._link("sun", sun), Vector(self.described["sun"]["direction"]).normalized()
            placed.rotation_mode = "QUATERNION"
            placed.rotation_quaternion = Vector((0, 0, -1)).rotation_difference(towards)

    def _add_volume(self) -> None:
        """The density as an OpenVDB grid, and its material; of channels, the first is the strongest."""
        import openvdb

        grids, emission = [], self.described["emission"]
        values = {"density": read_vol(self.folder / "density.vol")[..., 0]}
        if emission:
            values["glow"] = read_vol(self.folder / "emission.vol")[..., 0] / emission["radiance"][0]
        for name, array in values.items():
            grid = openvdb.FloatGrid()
            grid.name, grid.gridClass = name, openvdb.GridClass.FOG_VOLUME
            grid.copyFromArray(np.ascontiguousarray(array.transpose(2, 1, 0)))
            voxel = 1 / len(array)
            grid.transform = openvdb.createLinearTransform(voxelSize=voxel)
            grid.transform.postTranslate((voxel / 2,) * 3)
            grids.append(grid)
        path = self.folder / "volume.vdb"
        openvdb.write(str(path), grids=grids)
        volume = self.bpy.data.volumes.new("volume")
        volume.filepath, volume.render.precision = str(path), "FULL"
        self._link("volume", volume)
        volume.materials.append(self._medium())

    def _medium(self) -> Any:
        described, emission = self.described, self.described["emission"]
        sigma_t, albedo = np.array(described["sigma_t"]), np.array(described["albedo"])
        material, tree = self._material("medium")
        nodes = tree.nodes.new("ShaderNodeVolumeCoefficients")
        nodes.phase = "HENYEY_GREENSTEIN"
        nodes.inputs["Anisotropy"].default_value = described["g"]
        density = self._grid(tree, "density")
        coefficients = {"Absorption": sigma_t * (1 - albedo), "Scatter": sigma_t * albedo}
        for name, colour in coefficients.items():
            tree.links.new(_scaled(tree, colour, density), nodes.inputs[f"{name} Coefficients"])
        if emission:
            product = tree.nodes.new("ShaderNodeMath")
            product.operation = "MULTIPLY"
            for number, factor in enumerate((density, self._grid(tree, "glow"))):
                tree.links.new(factor, product.inputs[number])
            colour = sigma_t * (1 - albedo) * np.array(emission["radiance"])
            tree.links.new(_scaled(tree, colour, product.outputs[0]), nodes.inputs["Emission Coefficients"])
        tree.links.new(nodes.outputs[0], _output(tree).inputs["Volume"])
        material.cycles.volume_sampling, material.cycles.volume_interpolation = (
            "MULTIPLE_IMPORTANCE",
            "LINEAR",
        )
        return material

    def _material(self, name: str) -> tuple[Any, Any]:
        material = self.bpy.data.materials.new(name)
        material.use_nodes = True
        material.node_tree.nodes.clear()
        material.node_tree.nodes.new("ShaderNodeOutputMaterial")
        return material, material.node_tree

    def _grid(self, tree: Any, name: str) -> Any:
        attribute = tree.nodes.new("ShaderNodeAttribute")
        attribute.attribute_name = name
        return attribute.outputs["Fac"]

    def _add_quad(self, name: str, quad: dict[str, Any]) -> None:
        """A diffuse parallelogram; lamps shine from their front and are black behind."""
        corner, u, v = (np.array(quad[key], float) for key in ("corner", "u", "v"))
        mesh = self.bpy.data.meshes.new(name)
        corners = [corner, corner + u, corner + u + v, corner + v]
        mesh.from_pydata([tuple(place) for place in corners], [], [(0, 1, 2, 3)])
        self._link(name, mesh)
        material, tree = self._material(name)
        diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
        diffuse.inputs["Color"].default_value = (*quad["reflectance"], 1)
        diffuse.inputs["Roughness"].default_value = 0
        surface = diffuse.outputs[0]
        if quad["radiance"]:
            lamp = tree.nodes.new("ShaderNodeEmission")
            lamp.inputs["Strength"].default_value = quad["radiance"][0]
            lamp.inputs["Color"].default_value = (1, 1, 1, 1)
            sides, mixed = tree.nodes.new("ShaderNodeNewGeometry"), tree.nodes.new("ShaderNodeMixShader")
            tree.links.new(sides.outputs["Backfacing"], mixed.inputs[0])
            tree.links.new(lamp.outputs[0], mixed.inputs[1])
            tree.links.new(surface, mixed.inputs[2])
            surface, material.cycles.emission_sampling = mixed.outputs[0], "FRONT"
        tree.links.new(surface, _output(tree).inputs["Surface"])
        mesh.materials.append(material)

    def render(self, spp: int, seed: int) -> np.ndarray:
        """A picture, float32 (height, width, 3)."""
        self.scene.cycles.samples, self.scene.cycles.seed = spp, seed
        with tempfile.TemporaryDirectory() as folder:
            path = str(Path(folder) / "image.exr")
            self.scene.render.filepath = path
            self.bpy.ops.render.render(write_still=True)
            image = self.bpy.data.images.load(path)
            pixels = np.empty(self.res * self.res * 4, np.float32)
            image.pixels.foreach_get(pixels)
            self.bpy.data.images.remove(image)
        return pixels.reshape(self.res, self.res, 4)[::-1, :, :3].copy()


def _scaled(tree: Any, colour: np.ndarray, factor: Any) -> Any:
    """A colour times a number of the shader."""
    node = tree.nodes.new("ShaderNodeVectorMath")
    node.operation = "SCALE"
    node.inputs[0].default_value = tuple(colour)
    tree.links.new(factor, node.inputs["Scale"])
    return node.outputs[0]


def _output(tree: Any) -> Any:
    [node] = (node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    return node


def main() -> None:
    """Serve requests until the input ends."""
    form = argparse.RawDescriptionHelpFormatter
    argparse.ArgumentParser(description=__doc__, formatter_class=form).parse_args()
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # where Blender tells its progress
    warnings.simplefilter("ignore", DeprecationWarning)  # of the next Blender
    cycles, version = None, ""
    for line in sys.stdin:
        request, answer = json.loads(line), {}
        if "load" in request:
            import bpy

            version = bpy.app.version_string
        wall, cpu = time.perf_counter(), time.process_time()
        if "load" in request:
            cycles = Cycles(Path(request["load"]), request["res"], request["threads"])
            answer["version"] = version
        else:
            image = cycles.render(request["spp"], request["seed"])
        answer |= {"cpu": time.process_time() - cpu, "wall": time.perf_counter() - wall}
        if "load" not in request:
            np.save(request["image"], image)
        print(json.dumps(answer), file=answers, flush=True)
    answers.flush()
    os._exit(0)  # Blender's own way out may crash


if __name__ == "__main__":
    main()
