"""The medium of a run, made from what its scenario and its world say."""

import numpy as np

from swarmwire.comms.radio.config.phy import Antennas
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.traces import LinkTraces
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.world import World


def new_medium(scenario: Scenario, world: World, traces: LinkTraces | None) -> RadioMedium | None:
    """A new air of the scenario's radio, if it has one; `traces` are those of its file."""
    static, radio = world.static, scenario.radio
    if radio is None:
        return None
    return RadioMedium(
        radio,
        world.keys,
        static.robots,
        static.arena_size_m,
        world.obstacles,  # which follow those that are pushed
        static.rate_hz,
        static.act_every_ticks,
        np.concatenate([np.full(group.stop - group.start, group.body.radius_m) for group in static.groups]),
        traces,
        Antennas.of_groups((table.count, table.radio) for table in scenario.robots.values()),
        static.boundary,
    )
