"""Senses and actuators of the user's own: all that their classes are made of."""

from swarmwire.comms.config import parameter
from swarmwire.world.custom.actuators import CustomActuator
from swarmwire.world.custom.sensors import CustomSensor
from swarmwire.world.sensors.sensor import Field, Noise, Scene

__all__ = ["CustomActuator", "CustomSensor", "Field", "Noise", "Scene", "parameter"]
