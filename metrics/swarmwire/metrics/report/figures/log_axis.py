"""When an axis is better logarithmic, and how it is then labelled."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray

_DECADES = 2.0  # between the fifth and the ninety-fifth of a hundred values, from which on


def fits_log(values: FloatArray) -> bool:
    """Whether values (n,) are all above 0 and spread over so much that a linear axis would hide most of them."""
    known = values[np.isfinite(values)]
    if not len(known) or known.min() <= 0.0:
        return False
    low, high = np.quantile(known, (0.05, 0.95))
    return bool(np.log10(high / low) >= _DECADES)


def set_log(axis: Any) -> None:
    """Make an axis that all has been drawn on logarithmic, with numbers written out."""
    from matplotlib.ticker import LogLocator

    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    # Powers of ten alone would leave two decades with hardly a label.
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high < 1000.0 * max(low, 1e-300) else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs, numticks=8))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("")
