"""Behaviours that come with swarmwire, each a VectorAgent."""

from swarmwire.agent.behaviours.aggregation import Aggregation
from swarmwire.agent.behaviours.avoidance import Avoidance
from swarmwire.agent.behaviours.beacon_avoidance import BeaconAvoidance
from swarmwire.agent.behaviours.consensus import Consensus
from swarmwire.agent.behaviours.coverage import Coverage
from swarmwire.agent.behaviours.diffusion import Diffusion
from swarmwire.agent.behaviours.flocking import Flocking
from swarmwire.agent.behaviours.lennard_jones_flocking import LennardJonesFlocking
from swarmwire.agent.behaviours.minimalist_flocking import MinimalistFlocking
from swarmwire.agent.behaviours.pso_model import PsoModel
from swarmwire.agent.behaviours.pso_search import PsoSearch
from swarmwire.agent.behaviours.pso_search_positioned import PsoSearchPositioned
from swarmwire.agent.behaviours.random_walk import RandomWalk
from swarmwire.agent.behaviours.smoothed_avoidance import SmoothedAvoidance
from swarmwire.agent.behaviours.smoothed_avoidance_proximity import SmoothedAvoidanceProximity
from swarmwire.agent.behaviours.threshold_rule import ThresholdRule
from swarmwire.agent.behaviours.threshold_rule_proximity import ThresholdRuleProximity
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
