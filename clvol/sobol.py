"""The Sobol' sequence that paths draw their decisions from, as tables for the device.

Direction numbers: Joe and Kuo (2008), "Constructing Sobol' sequences with better
two-dimensional projections".  A path's decisions up to its second scattering take dimensions of one
sequence.  Later ones repeat its first four, with the samples in an order of their own (Burley 2020,
"Practical hash-based Owen scrambling").
"""

from __future__ import annotations

import numpy as np

_JOE_KUO = (  # from dimension 1 on: degree, coefficients of the primitive polynomial, first numbers m
    (1, 0, (1,)),
    (2, 1, (1, 3)),
    (3, 1, (1, 3, 1)),
    (3, 2, (1, 1, 1)),
    (4, 1, (1, 1, 3, 3)),
    (4, 4, (1, 3, 5, 13)),
    (5, 2, (1, 1, 5, 5, 17)),
    (5, 4, (1, 1, 5, 5, 5)),
    (5, 7, (1, 1, 7, 11, 19)),
    (5, 11, (1, 1, 5, 1, 1)),
    (5, 13, (1, 1, 1, 3, 11)),
    (5, 14, (1, 3, 5, 5, 31)),
    (6, 1, (1, 3, 3, 9, 7, 49)),
    (6, 13, (1, 1, 1, 15, 21, 21)),
    (6, 16, (1, 3, 1, 13, 27, 49)),
    (6, 19, (1, 1, 1, 15, 7, 5)),
    (6, 22, (1, 3, 1, 15, 13, 25)),
    (6, 25, (1, 1, 5, 5, 19, 61)),
    (7, 1, (1, 3, 7, 11, 23, 15, 103)),
    (7, 4, (1, 3, 7, 13, 13, 15, 69)),
    (7, 7, (1, 1, 3, 13, 7, 35, 63)),
    (7, 8, (1, 3, 5, 9, 1, 25, 53)),
    (7, 14, (1, 3, 1, 13, 9, 35, 107)),
    (7, 19, (1, 3, 1, 5, 27, 61, 31)),
    (7, 21, (1, 1, 5, 11, 19, 41, 61)),
)
DIMENSIONS = 1 + len(_JOE_KUO)

RANDOMIZATIONS = 4
"""Independent randomisations that the samples of a pixel are dealt to in turn; a power of two."""

GROUPS = (
    (0, 1, 22, 23),  # camera: pixel, lens
    (2, 3, 24, 25),  # first walk: distance, event, seed of the stream
    (4, 5, 6, 24),  # first light: choice, point
    (7, 24, 24, 25),  # first shadow ray: distance, -, seed of the stream
    (8, 9, 10, 11),  # first direction, roulette, lobe; at a surface opacity, direction, lobe
    (12, 13, 24, 25),  # second walk, and so on
    (14, 15, 16, 24),
    (17, 24, 24, 25),
    (18, 19, 20, 21),
    (0, 1, 2, 3),  # every other block
)
"""Dimensions of the four numbers of each block; no two that decide anything on one path share one."""


def direction_numbers() -> np.ndarray:
    """Column i of each dimension's generator matrix as a binary fraction; uint32 (DIMENSIONS, 32)."""
    columns = np.zeros((DIMENSIONS, 32), np.uint64)
    columns[0] = 1
    for row, (degree, coefficients, first) in zip(columns[1:], _JOE_KUO, strict=True):
        row[:degree] = first
        for i in range(degree, 32):  # Bratley and Fox (1988), equation 2
            value = int(row[i - degree]) ^ int(row[i - degree]) << degree
            for k in range(1, degree):
                if coefficients >> (degree - 1 - k) & 1:
                    value ^= int(row[i - k]) << k
            row[i] = value
    return (columns << np.arange(31, -1, -1, dtype=np.uint64)).astype(np.uint32)


def block_table() -> np.ndarray:
    """What four bits of an index add to a block's numbers, bits reversed; uint32 (groups, 8, 16, 4)."""
    columns = reverse_bits(direction_numbers())[np.array(GROUPS)]  # (groups, 4, 32)
    table = np.zeros((len(GROUPS), 8, 16, 4), np.uint32)
    for digit in range(8):
        for value in range(16):
            for bit in range(4):
                if value >> bit & 1:
                    table[:, digit, value] ^= columns[:, :, 4 * digit + bit]
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
    until = lambda n: (n - numbers + RANDOMIZATIONS - 1) // RANDOMIZATIONS  # noqa: E731
    return until(first + count) - until(first)
