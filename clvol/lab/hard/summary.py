"""What all renders of one case showed together, in figures."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.lab.hard.case import Seen


@dataclass(frozen=True)
class Summary:
    """Renders of one case.

    Parameters
    ----------
    case : its name.
    right, noisy, wrong : renders by verdict.
    expected, mean, error : by channel, one number where all are the same; mean and standard error of all that
        were not too noisy.
    accused : what was wrong, by the choices in force.
    device : that rendered it.
    """

    case: str
    right: int
    noisy: int
    wrong: int
    expected: tuple[float, ...]
    mean: tuple[float, ...]
    error: tuple[float, ...]
    accused: tuple[str, ...] = ()
    device: str = ""

    @classmethod
    def of(cls, seen: Sequence[Seen], alpha: float, device: str) -> Summary:
        """`alpha`: false-alarm rate of all these renders together."""
        level = alpha / len(seen)
        words = [one.word(level) for one in seen]
        used = [one for one, word in zip(seen, words, strict=True) if word != "too noisy"] or list(seen)
        mean = np.mean([one.mean for one in used], axis=0)
        error = np.sqrt(np.sum([np.square(one.error) for one in used], axis=0)) / len(used)
        accused = (one for one, word in zip(seen, words, strict=True) if word == "WRONG")
        expected = seen[0].expected
        return cls(
            seen[0].case.name,
            words.count("right"),
            words.count("too noisy"),
            words.count("WRONG"),
            _channels(expected, expected),
            _channels(mean, expected),
            _channels(error, expected),
            tuple(
                f"{one.names['technique']}, {one.names['transmittance']}, {one.names['majorant']}"
                for one in accused
            ),
            device,
        )

    @property
    def of_one(self) -> float:
        """Relative standard error of one way, root mean square, of the noisiest channel; 0 if it has none.

        That is what a way shows by itself, and `error` what all show together.
        """
        ways = self.right + self.wrong or self.noisy
        known = [e / m for e, m in zip(self.error, self.expected, strict=True) if m]
        return max(known, default=0.0) * math.sqrt(ways)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def _channels(values: np.ndarray, expected: np.ndarray) -> tuple[float, ...]:
    same = bool((expected == expected[0]).all())
    return tuple(float(v) for v in (values[:1] if same else values))
