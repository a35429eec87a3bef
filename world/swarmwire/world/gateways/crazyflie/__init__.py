"""The gateway of Bitcraze's Crazyflie: emulated robots that answer CRTP over UDP as the firmware does."""

from swarmwire.world.gateways.crazyflie.gateway import CrazyflieGateway

__all__ = ["CrazyflieGateway"]
