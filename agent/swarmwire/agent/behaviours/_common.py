"""Checks of parameters before a run, for all behaviours."""

from collections.abc import Mapping
from typing import Any

from swarmwire.agent.parameters import BadParameter


def check_order(kind: type, params: Mapping[str, Any], lower: str, upper: str) -> None:
    """Raise BadParameter if `lower` is more than `upper`; defaults are those of the class `kind`."""
    low, high = (params.get(name, getattr(kind, name)) for name in (lower, upper))
    if low > high:
        raise BadParameter(lower, f"expected at most {upper}, {high}; got {low}")
