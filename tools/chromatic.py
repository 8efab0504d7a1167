"""Is one chromatic render worth more than three grey ones?  And does a white medium throw fireflies?

A cloud whose extinction is 60, 30, 10 and whose albedo is 0.95, 0.9, 0.8 in red, green and blue, under a
white sky: the default technique against delta tracking of each channel by itself, by turns.  Three grey
renders of n samples each count as one render of n samples: their images are the channels, their times add up.
The bars: delta tracking of all events, absorption too ("sample"), and what `auto` takes for grey ("mixed").
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
from bench_tables import thread_count
from efficiency import Rounds, efficiency_ratio, image_mean, pixel_variance, z_score

from clvol.choices import Choices, prepare_for
from clvol.device import open_device
from clvol.scene import load_file
from clvol.scene.records import ConstVolume, Scene
from clvol.session import Session

CLOUD = Path(__file__).resolve().parent.parent / "scenes" / "cloud.xml"
SIGMA_T, ALBEDO = (60.0, 30.0, 10.0), (0.95, 0.9, 0.8)
FIREFLY = 30.0
"""A sample above so many times the largest pixel is one: a sky of radiance 1 lights nothing above 1."""


def cloud(scale: tuple[float, ...], albedo: tuple[float, ...], res: int) -> Scene:
    """scenes/cloud.xml with other coefficients, without a limit of depth."""
    scene = load_file(CLOUD, res=res)
    shape = scene.shapes[0]
    medium = replace(shape.interior, scale=scale, albedo=ConstVolume(albedo))
    integrator = replace(scene.integrator, max_depth=-1)
    return replace(scene, shapes=(replace(shape, interior=medium),), integrator=integrator)


def timed(device, scene: Scene, choices: Choices, spp: int, seed: int):
    """Result and CPU seconds of a render, kernels built before."""
    session = Session.open(device, prepare_for(scene, choices), choices, seed)
    started = time.process_time()
    done = session.run(0, spp, None, None, lambda: False)
    cpu = time.process_time() - started
    return session.result(0, done), cpu


@click.command()
@click.option("--res", default=64, show_default=True)
@click.option("--spp", default=128, show_default=True)
@click.option("--rounds", default=6, show_default=True, type=click.IntRange(min=2))
@click.option("--technique", default="auto", show_default=True, help="The chromatic side's.")
@click.option("--device", metavar="PATTERN", help="Part of the device's name; see clvol devices.")
def main(res: int, spp: int, rounds: int, technique: str, device: str | None) -> None:
    """Compare a chromatic render with three grey ones, in efficiency: 1 / (variance x CPU time)."""
    opened = open_device(device)
    chosen = Choices(technique=technique)
    whole = cloud(SIGMA_T, ALBEDO, res)
    greys = [cloud((s,), (a,), res) for s, a in zip(SIGMA_T, ALBEDO, strict=True)]
    bars = {name: Choices(technique="delta", absorption=name) for name in ("sample", "mixed")}
    for scene, choices in ((whole, chosen), *((grey, bar) for bar in bars.values() for grey in greys)):
        timed(opened, scene, choices, 4, 0)
    sides: dict[str, tuple[list, list]] = {name: ([], []) for name in ("chromatic", *bars)}
    for seed in range(1, rounds + 1):
        result, cpu = timed(opened, whole, chosen, spp, seed)
        sides["chromatic"][0].append(result.image)
        sides["chromatic"][1].append(cpu)
        for name, bar in bars.items():
            parts = [timed(opened, grey, bar, spp, seed + 1000 * c) for c, grey in enumerate(greys, 1)]
            sides[name][0].append(np.stack([r.image[..., 0] for r, _ in parts], axis=-1))
            sides[name][1].append(sum(cpu for _, cpu in parts))
    found = {name: Rounds(np.stack(images), np.array(cpu), spp) for name, (images, cpu) in sides.items()}
    print(f"sigma_t {SIGMA_T}, albedo {ALBEDO}, {res} x {res}, {rounds} rounds, {thread_count()} threads")
    print(f"chromatic: technique {result.metadata['technique']}, absorption {result.metadata['absorption']}")
    for name, side in found.items():
        what = "one chromatic render" if name == "chromatic" else f"three grey ones, absorption {name}"
        print(
            f"{what}: variance per sample {pixel_variance(side).mean():.5f}, "
            f"CPU us per sample {1e6 * np.median(side.cpu) / side.paths:.3f}"
        )
    for channel in range(3):
        part = np.s_[..., channel : channel + 1]
        one = [replace(found[name], images=found[name].images[part]) for name in ("chromatic", "mixed")]
        means = [image_mean(side) for side in one]
        print(f"channel {channel}: means {means[0][0]:.6f}, {means[1][0]:.6f}, z {z_score(*means):+.2f}")
    for name in bars:
        ratio = efficiency_ratio(found["chromatic"], found[name])
        print(
            f"efficiency, chromatic over three grey renders with absorption {name}: {ratio['median']:.2f} "
            f"(95 % interval {ratio['low']:.2f} to {ratio['high']:.2f})"
        )
    white = cloud(SIGMA_T, (0.999,) * 3, res)
    result, _ = timed(opened, white, chosen, 1000, 1)
    print(
        f"albedo 0.999, 1000 samples: brightest pixel {result.image.max():.3f}, largest sample "
        f"{result.stats['largest_sample']:.3f}, largest weight {result.stats['largest_weight']:.3f}: "
        + ("FIREFLIES" if result.stats["largest_sample"] > FIREFLY * result.image.max() else "no firefly")
    )


if __name__ == "__main__":
    main()
