"""Pseudo-random numbers for compiled code: the 64-bit state is part of the run, so a run is repeated bit for bit.

The generator is xorshift64* (S. Vigna, "An experimental exploration of Marsaglia's xorshift generators, scrambled",
ACM Trans. Math. Softw. 42, 2016): period 2⁶⁴ − 1.
"""

import math

import numpy as np
import numpy.typing as npt
from numba import njit

State = npt.NDArray[np.uint64]

_A, _B, _C, _SHIFT = np.uint64(12), np.uint64(25), np.uint64(27), np.uint64(11)
_FACTOR = np.uint64(0x2545F4914F6CDD1D)


def initial_rng(seed: int) -> State:
    """State of a generator, shape (1,), from an integer seed ≥ 0, hashed by NumPy's `SeedSequence`."""
    state = np.random.SeedSequence(seed).generate_state(1, np.uint64)
    return np.maximum(state, np.uint64(1))  # a zero state would stay zero


@njit
def uniform(state: State) -> float:
    """A uniform number in [0, 1); advances the state."""
    x = state[0]
    x ^= x >> _A
    x ^= x << _B
    x ^= x >> _C
    state[0] = x
    return float((x * _FACTOR) >> _SHIFT) * 2.0**-53


@njit
def normal(state: State) -> float:
    """A number of the standard normal distribution (Box and Muller 1958); advances the state twice."""
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(state)))
    return radius * math.cos(2.0 * math.pi * uniform(state))
