"""The extra [view]: rerun-sdk is 170 MB, so only those who look at runs install it."""

from importlib.util import find_spec

from swarmwire.comms.errors import BadInput


def need_view_extra(wanted_for: str) -> None:
    """Return if rerun-sdk is installed; BadInput tells how to get it."""
    if find_spec("rerun") is None or find_spec("rerun_bindings") is None:
        raise BadInput(wanted_for, "", "needs rerun-sdk: install swarmwire-metrics[view]")
