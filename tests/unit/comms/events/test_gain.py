"""Gains of antennas: each way for itself, adding up, undone one by one."""

from typing import Any

import numpy as np

from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.gain import Gain
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Swarm

SWARM = Swarm({"a": range(3)}, 3, np.array([7, 8], np.uint64), np.zeros((6, 3)))


def gain(*names: str, **keys: Any) -> Gain:
    return Gain(at_s=0.0, robots=Selection(names=names), for_s=1.0, **keys)


def test_gains_add_up_each_way_in_every_arena():
    conditions, events = Conditions(6), [gain("a-0", "a-1", send_db=-6.0), gain("a-1", send_db=2.0, receive_db=-3.0)]
    changed = [event.begin(serial, SWARM, conditions).tolist() for serial, event in enumerate(events)]
    assert changed == [[True, True, False] * 2, [False, True, False] * 2]
    now = conditions.disruption()
    assert now.send_gain_db.tolist() == [-6.0, -4.0, 0.0] * 2
    assert now.receive_gain_db.tolist() == [0.0, -3.0, 0.0] * 2
    assert events[0].end(0, conditions).tolist() == [True, True, False] * 2
    now = conditions.disruption()
    assert now.send_gain_db.tolist() == [0.0, 2.0, 0.0] * 2
    events[1].end(1, conditions)
    assert not conditions.disruption().send_gain_db.any()
