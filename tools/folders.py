"""Where the project is, and where tools keep what they install."""

from __future__ import annotations

import os
from pathlib import Path

TOOLS = Path(__file__).resolve().parent
ROOT = TOOLS.parent
SCENES = ROOT / "scenes"


def cached(name: str) -> Path:
    """The folder of something that tools install for themselves, in the user's cache."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return cache / "clvol" / name
