"""The driver of Bitcraze's Crazyflie, on Bitcraze's cflib."""

from swarmwire.agent.drivers.crazyflie.driver import CrazyflieDriver, CrazyflieOptions

__all__ = ["CrazyflieDriver", "CrazyflieOptions"]
