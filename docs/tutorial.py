# ruff: noqa: B018 (what a cell ends with is shown)
# %% [markdown]
# # Which technique is best on this smoke?
#
# The smoke of `scenes/smoke.xml` attenuates red, green and blue as 6 : 3 : 1. Three techniques follow a
# path through it: `delta` takes a path for each channel, `spectral` follows all channels at once, and
# `spectral-decomposition` also knows a part of the density without looking it up. All three have the same
# picture in the mean; they differ in what a sample costs and how much it varies.
#
# Run it cell by cell in any editor or notebook that knows `# %%`, or whole, from the folder of the
# checkout: `python docs/tutorial.py`. It takes about three minutes on two cores, and leaves its files in
# `tutorial/`. Its report needs matplotlib: `pip install '.[report]'`.

# %%
import os
from pathlib import Path

import clvol

QUICK = bool(os.environ.get("CLVOL_TUTORIAL_QUICK"))  # as the tests run it
SIZE = {"width": 12, "height": 16} if QUICK else {"width": 72, "height": 96}
SPP = 4 if QUICK else 32
TECHNIQUES = ["delta", "spectral", "spectral-decomposition"]
FOLDER = Path(os.environ.get("CLVOL_TUTORIAL_FOLDER", "tutorial"))
FOLDER.mkdir(parents=True, exist_ok=True)

# %% [markdown]
# ## A picture
# Keywords fill the scene's `<default>`s. A result shows itself as a picture; its pixels are in
# `result.image`, linear.

# %%
scene = clvol.load_file("scenes/smoke.xml", **SIZE)
result = clvol.render(scene, spp=SPP, seed=1)
result.save(FOLDER / "smoke.png")
result

# %% [markdown]
# ## Three techniques
# `noise` is the mean relative standard error of the picture, `stats` what it cost. Twice as many independent
# samples halve the variance and take twice as long, so that 1 / (variance · seconds) does not depend on how
# many there are: that is the efficiency. (The default, `sampler="sobol"`, gains with their number; there,
# compare renders of as many samples as you will use.) Times change with the machine, look-ups of the density
# do not; both are worth a look.

# %%
results = {
    name: clvol.render(scene, technique=name, sampler="independent", spp=SPP, seed=1) for name in TECHNIQUES
}


def efficiency(result, cost):
    """1 / (variance · cost), the variance averaged over the whole picture."""
    return 1 / (float(result.variance.mean()) * cost)


print(f"{'':24}{'noise':>8}{'seconds':>9}{'look-ups':>12}{'1/(var·s)':>12}{'1/(var·look-ups)':>18}")
for name, result in results.items():
    seconds, lookups = result.stats["seconds"]["render"], result.stats["lookups"]
    print(
        f"{name:24}{result.noise:8.2%}{seconds:9.2f}{lookups:12,}"
        f"{efficiency(result, seconds):12.4g}{efficiency(result, lookups):18.4g}"
    )

# %%
results["spectral"]  # the same picture, with noise of another kind

# %% [markdown]
# ## How sure is that?
# One render of each proves little: its variance is itself an estimate, and so is its time. `compare`
# renders all of them by turns with many seeds, compares with a reference made of others, and says which
# differences are significant.

# %%
comparison = clvol.compare(scene, techniques=TECHNIQUES, spp=SPP // 4, rounds=4 if QUICK else 10, seed=100)
comparison.save(FOLDER / "report")  # open report/report.html
print(comparison)

# %% [markdown]
# ## Why?
# One camera ray through the smoke, and what the techniques do along it: the density of the three channels
# under its majorant, the collisions of a few walks, and what many of them estimate. `delta` follows the
# green channel alone here, under a majorant of its own; the others need one for all channels, and pay with
# weights.

# %%
view = clvol.trace_ray(
    scene, SIZE["width"] * 100 // 288, SIZE["height"] * 60 // 384, techniques=TECHNIQUES, channel=1, seed=3
)
view.save(FOLDER / "ray.png")
print("\n".join(view.summary()))
view

# %% [markdown]
# ## What next
# `clvol compare`, `clvol selftest` and `clvol ray` do the same from the command line, on your own scenes;
# `clvol.render(scene, technique="auto:pilot")` measures by itself and picks what is best.
