"""Checks of parameters before a run, for all behaviours."""

from collections.abc import Mapping
from typing import Any

from swarmwire.agent.parameters import BadParameter


def check_above_zero(params: Mapping[str, Any], *names: str) -> None:
    """Raise BadParameter for the first of these parameters that is set and 0 or less."""
    for name in names:
        if name in params and params[name] <= 0:
            raise BadParameter(name, f"expected more than 0, got {params[name]}")


def check_not_negative(params: Mapping[str, Any], *names: str) -> None:
    """Raise BadParameter for the first of these parameters that is set and negative."""
    for name in names:
        if name in params and params[name] < 0:
            raise BadParameter(name, f"expected at least 0, got {params[name]}")


def check_share(params: Mapping[str, Any], name: str) -> None:
    """Raise BadParameter if the parameter is set and not within 0 and 1."""
    if name in params and not 0 <= params[name] <= 1:
        raise BadParameter(name, f"expected 0 to 1, got {params[name]}")


def check_order(kind: type, params: Mapping[str, Any], lower: str, upper: str) -> None:
    """Raise BadParameter if `lower` is more than `upper`; defaults are those of the class `kind`."""
    low, high = (params.get(name, getattr(kind, name)) for name in (lower, upper))
    if low > high:
        raise BadParameter(lower, f"expected at most {upper}, {high}; got {low}")
