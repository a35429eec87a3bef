"""Names of figures: of their files, and of what is named within them."""

import re

_OTHERS = re.compile(r"[^A-Za-z0-9._-]+")


def figure_name(*of: str) -> str:
    """What it shows, joined: `survival-aggregation_time_s-radio.loss`."""
    return "-".join(_OTHERS.sub("-", part) for part in of)
