"""Speed against error on a user's own scene: combinations of choices, measured by turns, and the report.

combine.py says what is compared, measure.py renders it, figures.py makes numbers of it and
findings.py holds them; words.py and table.py say it, plots.py draws it, report.py writes the folder, and
result.py is what a user has in hand.  The statistics are in `clvol.lab.efficiency` and `clvol.lab.agreement`.
Names are imported when first used, so that the command line stays quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from clvol.lab.comparison.comparing import compare
    from clvol.lab.comparison.result import Comparison

__all__ = ["Comparison", "compare"]

_EXPORTS = {"Comparison": "clvol.lab.comparison.result", "compare": "clvol.lab.comparison.comparing"}

if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        """Import a public name when it is first used."""
        if name not in _EXPORTS:
            raise AttributeError(f"module 'clvol.lab.comparison' has no attribute {name!r}")
        value = getattr(import_module(_EXPORTS[name]), name)
        globals()[name] = value
        return value
