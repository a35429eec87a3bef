"""Blackouts that overlap: radios are off while any holds them, and the strictest backlog counts."""

import numpy as np

from swarmwire.comms.air.disruption import ALL, DROP, NEWEST
from swarmwire.comms.events.blackout import Blackout
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Swarm

SWARM = Swarm({"a": range(3)}, 3, np.array([7], np.uint64), np.zeros((3, 3)))


def blackout(backlog: str, *names: str) -> Blackout:
    return Blackout(at_s=0.0, robots=Selection(names=names), backlog=backlog)


def test_the_strictest_backlog_counts_as_long_as_its_blackout_lasts():
    conditions = Conditions(3)
    events = [blackout("all", "a-0", "a-1"), blackout("newest", "a-1", "a-2"), blackout("drop", "a-2")]
    for serial, event in enumerate(events):
        event.begin(serial, SWARM, conditions)
    assert conditions.disruption().backlog_now.tolist() == [ALL, NEWEST, DROP]
    events[2].end(2, conditions)
    assert conditions.disruption().backlog_now.tolist() == [ALL, NEWEST, NEWEST]
    events[1].end(1, conditions)
    assert conditions.disruption().backlog_now.tolist() == [ALL, ALL, DROP]
    assert conditions.radio_on.tolist() == [False, False, True]


def test_packets_are_dropped_unless_the_scenario_says_otherwise():
    assert Blackout(at_s=0.0, robots=Selection(group="a")).backlog == "drop"
