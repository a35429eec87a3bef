"""Senses and actuators of the user's own: all that their classes are made of."""

from swarmwire.comms.config import parameter
from swarmwire.world.own.actuator import OwnActuator
from swarmwire.world.own.sensor import OwnSensor
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field, Noise

__all__ = ["Field", "Noise", "OwnActuator", "OwnSensor", "Scene", "parameter"]
