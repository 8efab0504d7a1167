"""Where the project's own files are."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCENES, TOOLS, CASES = ROOT / "scenes", ROOT / "tools", ROOT / "tests" / "cases"
