"""The built-in behaviours, each a VectorAgent."""

from swarmwire.agent.behaviours.aggregation import Aggregation
from swarmwire.agent.behaviours.avoidance import Avoidance, ThresholdRule, ThresholdRuleProximity
from swarmwire.agent.behaviours.beacon_avoidance import BeaconAvoidance
from swarmwire.agent.behaviours.consensus import Consensus
from swarmwire.agent.behaviours.flocking import Flocking
from swarmwire.agent.behaviours.lennard_jones_flocking import LennardJonesFlocking
from swarmwire.agent.behaviours.minimalist_flocking import MinimalistFlocking
from swarmwire.agent.behaviours.pso.variants import PsoModel, PsoSearch, PsoSearchPositioned
from swarmwire.agent.behaviours.random_walk import Coverage, Diffusion, RandomWalk
from swarmwire.agent.behaviours.smoothed_avoidance import SmoothedAvoidance, SmoothedAvoidanceProximity
from swarmwire.agent.behaviours.vicsek import Vicsek

__all__ = [
    "Aggregation",
    "Avoidance",
    "BeaconAvoidance",
    "Consensus",
    "Coverage",
    "Diffusion",
    "Flocking",
    "LennardJonesFlocking",
    "MinimalistFlocking",
    "PsoModel",
    "PsoSearch",
    "PsoSearchPositioned",
    "RandomWalk",
    "SmoothedAvoidance",
    "SmoothedAvoidanceProximity",
    "ThresholdRule",
    "ThresholdRuleProximity",
    "Vicsek",
]
