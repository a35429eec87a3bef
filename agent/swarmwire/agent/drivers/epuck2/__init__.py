"""The driver of GCtronic's e-puck2 over WiFi."""

from swarmwire.agent.drivers.epuck2.driver import Epuck2Driver

__all__ = ["Epuck2Driver"]
