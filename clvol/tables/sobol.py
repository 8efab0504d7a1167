"""The Sobol' sequence that paths draw their decisions from, as a table for the device.

Direction numbers: Joe and Kuo (2008), "Constructing Sobol' sequences with better two-dimensional
projections".  Every block of four decisions takes the same four dimensions, with the samples in an order of
its own (Burley 2020, "Practical hash-based Owen scrambling"): few samples fill the first two dimensions
better than any other pair, and decisions of different blocks meet at random.  Dimensions of its own for each
block would pair them once and for all, and at 8 samples some such pairs lie on a line.
"""

from __future__ import annotations

import numpy as np

from clvol.layout import RANDOMIZATIONS

_JOE_KUO = (  # from dimension 1 on: degree, coefficients of the primitive polynomial, first numbers m
    (1, 0, (1,)),
    (2, 1, (1, 3)),
    (3, 1, (1, 3, 1)),
)
_JOINT = (  # found by search: the most even parts, and the most even whole
    (1, 0, (1,)),
    (3, 1, (1, 3, 7)),
    (3, 2, (1, 1, 3)),
)
DIMENSIONS = 4


def direction_numbers(joint: bool = False) -> np.ndarray:
    """Column i of each dimension's generator matrix as a binary fraction; uint32 (DIMENSIONS, 32).

    joint : of the sequence whose points, dealt in turn, make four parts as even as itself.  Take the bits of
        a point's number in a Sobol' sequence as the coefficients of a polynomial over two elements.  Those of
        part r are q j + r, with q = 1 + z + z², j the point's number in its part, and r that of the part: all
        together are all polynomials, with remainder r.  A multiple of q is 0 in the leading digits of a
        dimension only where j is, as long as the dimension's own polynomial has no factor in common with q:
        so a part's points are as far apart as those of the sequence.  The third and fourth dimension of Joe
        and Kuo, of which one has q itself, make way for others.
    """
    columns = np.zeros((DIMENSIONS, 32), np.uint64)
    columns[0] = 1
    for row, (degree, coefficients, first) in zip(columns[1:], _JOINT if joint else _JOE_KUO, strict=True):
        row[:degree] = first
        for i in range(degree, 32):  # Bratley and Fox (1988), equation 2
            value = int(row[i - degree]) ^ int(row[i - degree]) << degree
            for k in range(1, degree):
                if coefficients >> (degree - 1 - k) & 1:
                    value ^= int(row[i - k]) << k
            row[i] = value
    numbers = (columns << np.arange(31, -1, -1, dtype=np.uint64)).astype(np.uint32)
    if joint:  # two bits of r, then those of j
        numbers[:, 2:] = numbers[:, :-2] ^ numbers[:, 1:-1] ^ numbers[:, 2:]
    return numbers


def block_table(joint: bool = False) -> np.ndarray:
    """What four bits of an index add to a block's numbers, bits reversed; uint32 (8, 16, 4)."""
    columns = reverse_bits(direction_numbers(joint))
    table = np.zeros((8, 16, 4), np.uint32)
    for digit in range(8):
        for value in range(16):
            for bit in range(4):
                if value >> bit & 1:
                    table[digit, value] ^= columns[:, 4 * digit + bit]
    return table


def reverse_bits(x: np.ndarray) -> np.ndarray:
    """The 32 bits of each number in reverse order."""
    x = np.asarray(x, np.uint32)
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF), (16, 0x0000FFFF)):
        low = np.uint32(mask)
        x = (x >> np.uint32(shift)) & low | (x & low) << np.uint32(shift)
    return x


def samples_of_each(first: int, count: int) -> np.ndarray:
    """How many of the samples `first` to `first + count` each randomisation has; int64 (RANDOMIZATIONS,)."""
    numbers = np.arange(RANDOMIZATIONS)
    first_of, end_of = ((n - numbers + RANDOMIZATIONS - 1) // RANDOMIZATIONS for n in (first, first + count))
    return end_of - first_of
