"""Threshold: a frame is right if the signal stands so far above noise and interference."""

# pyright: basic, reportUnknownMemberType=false

from numba import njit


@njit(cache=True)
def threshold_success(least_sinr, sinr):
    """1 if SINR, a ratio, reaches the least, else 0; whatever the number of bits."""
    return 1.0 if sinr >= least_sinr else 0.0
