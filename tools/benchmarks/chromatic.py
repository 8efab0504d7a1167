"""Whether one chromatic render is worth more than three grey ones, and a white medium throws fireflies.

A cloud whose extinction is 60, 30, 10 and whose albedo is 0.95, 0.9, 0.8 in red, green and blue, under a
white sky: the default technique against delta tracking of each channel by itself, by turns.  Three grey
renders of n samples each count as one render of n samples: their images are the channels, their times add up.
The bars: delta tracking of all events, absorption too ("sample"), and what `auto` takes for grey ("mixed").
"""

from __future__ import annotations

from dataclasses import replace

import click
import numpy as np
from folders import SCENES
from scene_options import OpenScene

from benchmarks.efficiency import Rounds, efficiency_ratio, image_mean, pixel_variance, z_score
from benchmarks.tables import Figures, Row, ranged, thread_count
from clvol.cli.options import device_option
from clvol.device.device import open_device
from clvol.planning.choices import Choices
from clvol.scene import load_file
from clvol.scene.records import ConstVolume, Scene

SIGMA_T, ALBEDO = (60.0, 30.0, 10.0), (0.95, 0.9, 0.8)
BARS = ("sample", "mixed")
FIREFLY = 30.0
"""A sample above so many times the largest pixel is one: a sky of radiance 1 lights nothing above 1."""


def cloud(scale: tuple[float, ...], albedo: tuple[float, ...], res: int) -> Scene:
    """scenes/cloud.xml with other coefficients, without a limit of depth."""
    scene = load_file(SCENES / "cloud.xml", res=res)
    shape = scene.shapes[0]
    medium = replace(shape.interior, scale=scale, albedo=ConstVolume(albedo))
    integrator = replace(scene.integrator, max_depth=-1)
    return replace(scene, shapes=(replace(shape, interior=medium),), integrator=integrator)


def measure_chromatic(res: int, spp: int, rounds: int, technique: str, device: str | None) -> Figures:
    """Render by turns; both sides' cost, their means and the ratios of efficiency; the brightest sample."""
    opened = open_device(device)

    def ready(choices: Choices, scale: tuple[float, ...], albedo: tuple[float, ...]) -> OpenScene:
        return OpenScene.of(opened, cloud(scale, albedo, res), choices)

    chosen = Choices(technique=technique)
    whole = ready(chosen, SIGMA_T, ALBEDO)
    bars = {
        name: [
            ready(Choices(technique="delta", absorption=name), (s,), (a,))
            for s, a in zip(SIGMA_T, ALBEDO, strict=True)
        ]
        for name in BARS
    }
    for scene in (whole, *(grey for greys in bars.values() for grey in greys)):
        scene.render(4, 0)
    sides: dict[str, list[tuple[np.ndarray, float]]] = {name: [] for name in ("chromatic", *bars)}
    for seed in range(1, rounds + 1):
        result, cpu, _ = whole.render(spp, seed)
        sides["chromatic"].append((result.image, cpu))
        for name, greys in bars.items():
            parts = [grey.render(spp, seed + 1000 * c) for c, grey in enumerate(greys, 1)]
            image = np.stack([part.result.image[..., 0] for part in parts], axis=-1)
            sides[name].append((image, sum(part.cpu for part in parts)))
    found = {name: Rounds.of(renders, spp) for name, renders in sides.items()}
    channels = [[part(found[name], channel) for name in ("chromatic", "mixed")] for channel in range(3)]
    white = ready(chosen, SIGMA_T, (0.999,) * 3).render(8 * spp, 1).result
    return {
        "res": res,
        "rounds": rounds,
        "choices": {family: result.metadata[family] for family in ("technique", "absorption")},
        "sides": {
            name: {
                "variance": float(pixel_variance(side).mean()),
                "microseconds": float(1e6 * np.median(side.cpu) / side.paths),
            }
            for name, side in found.items()
        },
        "means": [[image_mean(side) for side in pair] for pair in channels],
        "ratios": {name: efficiency_ratio(found["chromatic"], found[name]) for name in bars},
        "white": {"samples": 8 * spp, "brightest": float(white.image.max())}
        | {name: float(white.stats[name]) for name in ("largest_sample", "largest_weight")},
    }


def part(side: Rounds, channel: int) -> Rounds:
    """One channel of a side."""
    return replace(side, images=side.images[..., channel : channel + 1])


def show_chromatic(figures: Figures) -> None:
    """Both sides and their means, and whether there are fireflies."""
    res, rounds, choices = (figures[name] for name in ("res", "rounds", "choices"))
    print(f"sigma_t {SIGMA_T}, albedo {ALBEDO}, {res} x {res}, {rounds} rounds, {thread_count()} threads")
    print(f"chromatic: technique {choices['technique']}, absorption {choices['absorption']}")
    for name, side in figures["sides"].items():
        what = "one chromatic render" if name == "chromatic" else f"three grey ones, absorption {name}"
        costs = f"variance per sample {side['variance']:.5f}, CPU us per sample {side['microseconds']:.3f}"
        print(f"{what}: {costs}")
    for channel, (ours, grey) in enumerate(figures["means"]):
        print(f"channel {channel}: means {ours[0]:.6f}, {grey[0]:.6f}, z {z_score(ours, grey):+.2f}")
    for name, ratio in figures["ratios"].items():
        print(
            f"efficiency, chromatic over three grey renders with absorption {name}: {ratio['median']:.2f} "
            f"(95 % interval {ratio['low']:.2f} to {ratio['high']:.2f})"
        )
    white = figures["white"]
    print(
        f"albedo 0.999, {white['samples']} samples: brightest pixel {white['brightest']:.3f}, largest sample "
        f"{white['largest_sample']:.3f}, largest weight {white['largest_weight']:.3f}: "
        + ("FIREFLIES" if white["largest_sample"] > FIREFLY * white["brightest"] else "no firefly")
    )


def chromatic_rows(figures: Figures) -> list[Row]:
    """What one chromatic render is worth."""
    technique = figures["choices"]["technique"]
    how = f"`{technique}`" + (", a path for each channel" if technique == "delta" else "")
    sample, mixed = (ranged(figures["ratios"][name], 2) for name in BARS)
    return [
        Row(
            f"one chromatic render ({how}) over three grey ones of the same channels",
            f"{sample} times with absorption `sample`, {mixed} with `mixed`",
        )
    ]


@click.command()
@click.option("--res", default=64, show_default=True)
@click.option("--spp", default=128, show_default=True)
@click.option("--rounds", default=6, show_default=True, type=click.IntRange(min=2))
@click.option("--technique", default="auto", show_default=True, help="The chromatic side's.")
@device_option
def main(
    res: int, spp: int, rounds: int, technique: str, device: str | None
) -> tuple[None, dict[str, Figures]]:
    """Compare a chromatic render with three grey ones, in efficiency: 1 / (variance x CPU time)."""
    figures = measure_chromatic(res, spp, rounds, technique, device)
    show_chromatic(figures)
    return None, {"chromatic": figures}
