"""Files of spectra: a wavelength in nanometres and a value in each line, and comments behind a #."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import SceneError, shortened

if TYPE_CHECKING:
    from pathlib import Path

MOST_BYTES = 1 << 20


def read_spectrum(path: Path, where: str) -> np.ndarray:
    """Wavelengths and values, float64 (n, 2), as they stand in the file.

    Raises
    ------
    SceneError
        At `where`: the file cannot be read, is longer than `MOST_BYTES`, or has a line of anything else.
    """
    try:
        with open(path, "rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise SceneError(f"cannot read '{path}': {error.strerror}", where) from None
    if len(content) > MOST_BYTES:
        raise SceneError(f"'{path}' is too long for a spectrum: more than {MOST_BYTES:,} bytes", where)
    pairs = []
    for number, line in enumerate(content.decode("utf-8", "replace").splitlines(), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            wavelength, value = map(float, words)
        except ValueError:
            what = f"line {number} of '{path}' is no wavelength and value: '{shortened(line.strip(), 40)}'"
            raise SceneError(what, where, "write as 500 0.7") from None
        pairs.append((wavelength, value))
    return np.array(pairs, np.float64).reshape(-1, 2)
