"""What `clvol render --profile` prints: where the time of the render went."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from clvol.base.memory import format_bytes

if TYPE_CHECKING:
    from clvol.picture.profile import KernelProfile, Profile

COLUMNS = ("", "seconds", "share", "launches", "µs a launch", "items", "ns an item", "bytes an item")
_SHORTEST = 5e-4
"""Seconds of a step that is worth a word."""


def profile_lines(profile: Profile) -> list[str]:
    """A table, then what the render cost beside the stages' kernels, then the steps before and after it."""
    copied = profile.copied
    rows = [
        *(_kernel_row(name, kernel, profile.seconds) for name, kernel in profile.kernels.items()),
        _row("copies", copied.seconds, profile.seconds, copied.copies),
        _row("launching and waiting", profile.host_seconds, profile.seconds),
    ]
    steps = [f"{name} {seconds:.3g}" for name, seconds in profile.steps.items() if seconds > _SHORTEST]
    return [
        *_table(rows),
        f"  outside of the stages' kernels: {100 * profile.outside:.1f} % of {profile.seconds:.3g} s; "
        f"{format_bytes(copied.bytes)} copied; {profile.cpu_seconds / profile.seconds:.2f} threads busy",
        *([] if profile.lanes_busy is None else [f"  lanes busy: {100 * profile.lanes_busy:.0f} %"]),
        f"  seconds before and after: {', '.join(steps)}",
    ]


def _row(name: str, seconds: float, of: float, count: int = 0) -> list[str]:
    """What every row begins with; `count`: launches or copies."""
    each = _brief(1e6 * seconds / count) if count else "-"
    return [name, f"{seconds:.3f}", f"{100 * seconds / of:.1f} %", f"{count:,}" if count else "-", each]


def _brief(number: float) -> str:
    return f"{number:.3g}" if number < 100 else f"{number:,.0f}"


def _kernel_row(name: str, kernel: KernelProfile, of: float) -> list[str]:
    each = kernel.nanoseconds
    return [
        *_row(name, kernel.seconds, of, kernel.launches),
        f"{kernel.items:,}",
        "-" if each is None else _brief(each),
        str(kernel.item_bytes),
    ]


def _table(rows: list[list[str]]) -> list[str]:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE)
    for name in COLUMNS:
        table.add_column(name, justify="right" if name else "left")
    for row in rows:
        table.add_row(*map(Text, row))
    text = io.StringIO()
    Console(file=text, width=10_000, color_system=None).print(table)
    return [line.rstrip() for line in text.getvalue().splitlines() if line.strip()]
