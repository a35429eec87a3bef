"""Elementary functions with the same bits on every machine, for agents whose runs are to repeat anywhere.

>>> from swarmwire.agent import portable
>>> portable.atan2(1.0, 1.0)
0.7853981633974483
"""

from swarmwire.comms.base.math import (
    asin,
    atan,
    atan2,
    cos,
    erfc,
    exp,
    expm1,
    hypot,
    log,
    log1p,
    log2,
    log10,
    ordered_sum,
    power,
    sin,
    tan,
)

__all__ = [
    "asin",
    "atan",
    "atan2",
    "cos",
    "erfc",
    "exp",
    "expm1",
    "hypot",
    "log",
    "log1p",
    "log2",
    "log10",
    "ordered_sum",
    "power",
    "sin",
    "tan",
]
