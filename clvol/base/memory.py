"""Bytes: how many this process may still take, as far as the system tells, and how people write them.

To ask is worth it before much is taken: systems promise more than there is, and kill whoever uses it.
"""

from __future__ import annotations

import resource
from pathlib import Path


def format_bytes(count: float) -> str:
    """Number of bytes as people write it: "512 B", "1.5 MiB"."""
    for unit in ("B", "KiB", "MiB", "GiB"):
        if count < 1024 or unit == "GiB":
            break
        count /= 1024
    return f"{count:.4g} {unit}"


def available_memory() -> int | None:
    """Bytes this process may still take: by the machine, its group and its limits; None if unknown."""
    found = [_free_of_machine(), _free_of_group(), _free_of_process()]
    return min((size for size in found if size is not None), default=None)


def _free_of_machine() -> int | None:
    kilobytes = _fields(Path("/proc/meminfo")).get("MemAvailable:")
    return None if kilobytes is None else 1024 * kilobytes


def _free_of_group(root: Path = Path("/sys/fs/cgroup")) -> int | None:
    """Of the process's control group, as containers have one; what only caches files counts as free."""
    for folder, limit, used, cached in (
        (root, "memory.max", "memory.current", "inactive_file"),
        (root / "memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
    ):
        try:
            free = int((folder / limit).read_text()) - int((folder / used).read_text())
        except (OSError, ValueError):  # no such group, or no limit ("max")
            continue
        return max(0, free + _fields(folder / "memory.stat").get(cached, 0))
    return None


def _free_of_process() -> int | None:
    """Of the address space that `ulimit -v` grants."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    used = _fields(Path("/proc/self/status")).get("VmSize:")
    if limit == resource.RLIM_INFINITY or used is None:
        return None
    return max(0, limit - 1024 * used)


def _fields(path: Path) -> dict[str, int]:
    """Lines of "name number …" in one of the system's files."""
    try:
        lines = [line.split() for line in path.read_text().splitlines()]
    except OSError:
        return {}
    return {words[0]: int(words[1]) for words in lines if len(words) > 1 and words[1].isdigit()}
