"""In a notebook results show themselves, and the tutorial runs from its first cell to its last."""

import os
import subprocess
import sys

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from places import ROOT

from clvol.picture.dither import codes
from clvol.picture.estimate import Moments
from clvol.picture.image_io import shown_pixels
from clvol.picture.result import Result
from clvol.picture.view_transform import View


def test_a_result_shows_itself_as_a_png(tmp_path):
    image = np.linspace(0, 3, 4 * 6 * 3).reshape(4, 6, 3)
    result = Result.from_estimate(Moments(5 * image, 5 * image**2, 5), (0, 5), {}, {}, {"spp": 5})
    png = result._repr_png_()
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    (tmp_path / "shown.png").write_bytes(png)
    pixels = oiio.ImageBuf(str(tmp_path / "shown.png")).get_pixels(oiio.UINT8)
    shown = shown_pixels(result.image, None, View().resolved())
    np.testing.assert_array_equal(pixels, codes(shown))


@pytest.mark.contract
def test_the_tutorial_runs(tmp_path):
    quick = {"CLVOL_TUTORIAL_QUICK": "1", "CLVOL_TUTORIAL_FOLDER": str(tmp_path)}
    run = subprocess.run(
        [sys.executable, "docs/tutorial.py"], cwd=ROOT, env=os.environ | quick, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    for name in ("smoke.png", "ray.png", "report/report.html"):
        assert (tmp_path / name).stat().st_size > 0
    for name in ("delta", "spectral", "spectral-decomposition"):
        assert run.stdout.count(name) >= 2  # alone, and along a ray
