"""Behaviours that come with swarmwire, each a VectorAgent."""

from swarmwire.agent.behaviours.avoidance import Avoidance
from swarmwire.agent.behaviours.diffusion import Diffusion
from swarmwire.agent.behaviours.flocking import Flocking

__all__ = ["Avoidance", "Diffusion", "Flocking"]
