"""Checks of parameters before a run, shared by behaviours."""

from collections.abc import Mapping
from typing import Any

from swarmwire.agent.parameters import BadParameter


def check_above_zero(params: Mapping[str, Any], *names: str) -> None:
    """BadParameter for the first of these that is given and is 0 or less."""
    for name in names:
        if name in params and params[name] <= 0:
            raise BadParameter(name, f"expected more than 0, got {params[name]}")


def check_not_negative(params: Mapping[str, Any], *names: str) -> None:
    """BadParameter for the first of these that is given and is less than 0."""
    for name in names:
        if name in params and params[name] < 0:
            raise BadParameter(name, f"expected at least 0, got {params[name]}")


def check_share(params: Mapping[str, Any], name: str) -> None:
    """BadParameter if it is given and is not within 0 and 1."""
    if name in params and not 0 <= params[name] <= 1:
        raise BadParameter(name, f"expected 0 to 1, got {params[name]}")


def check_order(kind: type, params: Mapping[str, Any], lower: str, upper: str) -> None:
    """BadParameter if `lower` is more than `upper`; one that is not given has the default of the class `kind`."""
    low, high = (params.get(name, getattr(kind, name)) for name in (lower, upper))
    if low > high:
        raise BadParameter(lower, f"expected at most {upper}, {high}; got {low}")
