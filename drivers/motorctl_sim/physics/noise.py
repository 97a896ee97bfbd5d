"""Random numbers of one axis: xoshiro256++ (Blackman, Vigna 2019), a state in its record.

A generator of its own for each axis keeps an axis' noise the same whatever other axes do.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from motorctl.hal import inner_kernel

_17 = np.uint64(17)
_23 = np.uint64(23)
_41 = np.uint64(41)
_45 = np.uint64(45)
_19 = np.uint64(19)
_11 = np.uint64(11)


@inner_kernel
def uniform(s: NDArray[np.uint64]) -> float:
    """Draw from [0, 1) and step the state s, shape (4,)."""
    total = s[0] + s[3]
    drawn = ((total << _23) | (total >> _41)) + s[0]
    shifted = s[1] << _17
    s[2] ^= s[0]
    s[3] ^= s[1]
    s[1] ^= s[2]
    s[0] ^= s[3]
    s[2] ^= shifted
    s[3] = (s[3] << _45) | (s[3] >> _19)
    return float(drawn >> _11) * 2.0**-53


@inner_kernel
def normal_pair(s: NDArray[np.uint64]) -> tuple[float, float]:
    """Draw two independent standard normal numbers (Marsaglia's polar method)."""
    while True:
        a = 2.0 * uniform(s) - 1.0
        b = 2.0 * uniform(s) - 1.0
        r = a * a + b * b
        if 0.0 < r < 1.0:
            scale = math.sqrt(-2.0 * math.log(r) / r)
            return a * scale, b * scale
