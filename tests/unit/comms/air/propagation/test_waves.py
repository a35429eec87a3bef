"""Sums of waves: as many are added up as there are."""

import numpy as np
from numba import njit

from swarmwire.comms.air.propagation.waves import SUMS, total


@njit  # pyright: ignore[reportUntypedFunctionDecorator] - numba is untyped
def total_of(s):
    return total(s)


def test_a_total_has_each_of_the_sums_once():
    powers = 2.0 ** np.arange(SUMS)
    assert total_of(powers) == 2.0**SUMS - 1.0
