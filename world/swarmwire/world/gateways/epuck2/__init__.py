"""The gateway of GCtronic's e-puck2: emulated robots that answer over TCP as the firmware does."""

from swarmwire.world.gateways.epuck2.gateway import Epuck2Gateway

__all__ = ["Epuck2Gateway"]
