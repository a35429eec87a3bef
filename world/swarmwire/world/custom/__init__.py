"""Senses and actuators of the user's own: all that their classes are made of."""

from swarmwire.comms.config import parameter
from swarmwire.world.custom.actuators import OwnActuator
from swarmwire.world.custom.sensors import OwnSensor
from swarmwire.world.sensors.sensor import Field, Noise, Scene

__all__ = ["Field", "Noise", "OwnActuator", "OwnSensor", "Scene", "parameter"]
