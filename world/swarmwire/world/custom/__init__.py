"""Custom sensors and actuators: the names that a user's class imports."""

from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.sensors.sensor import Field, Noise
from swarmwire.world.custom.actuators import CustomActuator
from swarmwire.world.sensors.sensor import CustomSensor, Scene

__all__ = ["CustomActuator", "CustomSensor", "Field", "Noise", "Scene", "parameter"]
