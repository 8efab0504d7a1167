"""Measurements that need a process of their own: modules of this folder, run as programs."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

from folders import TOOLS

if TYPE_CHECKING:
    from collections.abc import Mapping


def output_of(module: str, *arguments: str, environment: Mapping[str, str] | None = None) -> str:
    """What `python -m benchmarks.MODULE ARGUMENTS` prints, with these variables changed."""
    command = [sys.executable, "-m", f"benchmarks.{module}", *arguments]
    environment = os.environ | dict(environment or {})
    return subprocess.run(
        command, check=True, stdout=subprocess.PIPE, text=True, cwd=TOOLS, env=environment
    ).stdout
