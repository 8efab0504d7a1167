"""What `clvol.compare` returns: what it found, in figures and in words, and the report of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol.lab.comparison.findings import Findings
from clvol.lab.comparison.report import write_report
from clvol.lab.comparison.table import text_table
from clvol.lab.comparison.words import sentences

if TYPE_CHECKING:
    import os


class Comparison(Findings):
    """Combinations compared on one scene; the fields are those of `Findings`."""

    @property
    def words(self) -> tuple[str, ...]:
        """What was found, in sentences."""
        return tuple(sentence.text for sentence in sentences(self))

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write the report: report.json, report.html and plots as PNG; completely or not at all.

        OptionError for a folder that holds anything but an earlier report, or cannot be written.
        """
        write_report(self, folder)

    def __repr__(self) -> str:
        return text_table(self)
