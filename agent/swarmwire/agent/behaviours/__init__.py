"""Behaviours that come with swarmwire, each a VectorAgent."""

from swarmwire.agent.behaviours.avoidance import Avoidance
from swarmwire.agent.behaviours.diffusion import Diffusion
from swarmwire.agent.behaviours.flocking import Flocking
from swarmwire.agent.behaviours.pso_search import PsoSearch
from swarmwire.agent.behaviours.pso_search_positioned import PsoSearchPositioned

__all__ = ["Avoidance", "Diffusion", "Flocking", "PsoSearch", "PsoSearchPositioned"]
