"""Nakagami-m fading: power gains between Rayleigh's (m = 1), worse (m < 1) and none (m large), as measurements fit it.

g = Q(F(r)), with r Rayleigh's gain, F its distribution and Q the quantile of Gamma(m, 1/m): mean 1, variance 1/m, and
correlated in time as r is (M. Nakagami, 1960; by quantiles: Beaulieu and Cheng, IEEE Trans. Vehicular Techn. 54, 2005).
"""

# pyright: basic, reportUnknownMemberType=false

import math

from numba import njit

from swarmwire.comms.air.propagation.gamma import gamma_quantile


@njit(cache=True)
def nakagami_gain(rayleigh_gain, m):
    """The power gain of which Rayleigh's would be as rare; m >= 0.5. About 0.5 us; nothing to do for m = 1."""
    if m == 1.0:
        return rayleigh_gain
    return gamma_quantile(m, -math.expm1(-rayleigh_gain), math.exp(-rayleigh_gain)) / m
