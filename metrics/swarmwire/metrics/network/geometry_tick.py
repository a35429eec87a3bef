"""The tick whose poses decide about a packet."""

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.clock import NS_PER_S

POSES_KEPT_S = 5.0  # simulated: where robots were when a packet went on air is unknown of one on its way for longer


def geometry_tick(on_air_at_ns: IntArray, rate_hz: int) -> IntArray:
    """The last tick that starts no later than the packet goes on air, (k,): its poses are the geometry."""
    return ((on_air_at_ns + 1) * rate_hz - 1) // NS_PER_S
