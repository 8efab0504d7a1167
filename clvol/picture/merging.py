"""Results of disjoint sample ranges of one render become the result of all samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol.base.arguments import listed
from clvol.errors import OptionError, shown
from clvol.picture.parts import Part, added
from clvol.picture.result import Result

if TYPE_CHECKING:
    from collections.abc import Iterable


def merge(results: Iterable[Result]) -> Result:
    """Combine results of disjoint sample ranges of one render into the result of all samples.

    Sums and counts add up; AOVs are means weighted by the samples; statistics add, but for maxima and
    sizes (names that begin with "largest", "peak", "bytes", "slots", "pool"), of which the largest stays, and
    for means per path ("energy…"), which are weighted by the paths.

    Parameters
    ----------
    results
        At least one, as `clvol.render` and `clvol.load_result` returned them, in any order.

    Returns
    -------
    Result
        The picture of all samples, as if it had been rendered at once.

    Raises
    ------
    OptionError
        No results, or something else; overlapping sample ranges; or another size, scene, seed or choice:
        which, it says.
    """
    given = None if isinstance(results, Result) else listed(results)
    if given is None:
        raise OptionError("merge takes a list of results", hint="merge([a, b])")
    if not given:
        raise OptionError("nothing to merge", hint="give at least one result")
    for one in given:
        if not isinstance(one, Result):
            raise OptionError(
                f"merge takes what clvol.render returns, not {shown(one)}",
                hint="clvol.load_result reads what was saved",
            )
    return added([Part.of(result) for result in given]).result()
