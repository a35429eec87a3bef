"""Jammers: where they stand, who carries them, and when they are on."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.air.jammers import NO_ROBOT, Jammers
from swarmwire.comms.air.propagation.log_distance import LogDistance
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.jammer import Jammer
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Swarm

KEYS = np.array([7, 8], np.uint64)
SWARM = Swarm({"a": range(3)}, 3, KEYS, np.arange(18.0).reshape(6, 3))


def jammer(**keys: Any) -> Jammer:
    return Jammer(at_s=0.0, power_dbm=10.0, for_s=1.0, **keys)


def put_up(event: Jammer, swarm: Swarm = SWARM, serial: int = 0) -> Jammers:
    conditions = Conditions(swarm.rows)
    event.begin(serial, swarm, conditions)
    return conditions.disruption().jammers


def test_one_stands_at_its_place_in_every_arena():
    found = put_up(jammer(at=(1.0, -2.0)))
    assert found.arena.tolist() == [0, 1]
    assert found.carrier.tolist() == [NO_ROBOT, NO_ROBOT]
    assert found.places(SWARM.pose).tolist() == [[1.0, -2.0]] * 2


def test_one_that_is_carried_is_where_its_robot_is():
    found = put_up(jammer(robots=Selection(names=("a-1",))))
    assert found.arena.tolist() == [0, 1]
    assert found.carrier.tolist() == [1, 4]
    assert found.places(SWARM.pose).tolist() == [[3.0, 4.0], [12.0, 13.0]]


def test_those_of_several_events_add_up_and_go_one_by_one():
    conditions = Conditions(6)
    standing, carried = jammer(at=(0.0, 0.0)), jammer(robots=Selection(count=2))
    assert standing.begin(0, SWARM, conditions).all()
    chosen = carried.begin(1, SWARM, conditions)
    assert chosen.reshape(2, 3).sum(axis=1).tolist() == [2, 2]
    assert len(conditions.disruption().jammers.arena) == 6
    assert standing.end(0, conditions).all()
    assert carried.end(1, conditions).tolist() == chosen.tolist()
    assert len(conditions.disruption().jammers.arena) == 0


def test_the_phase_is_the_arenas_own_and_each_jammers():
    event = jammer(robots=Selection(group="a"), duty=0.5, period_s=1.0)
    together = put_up(event).phase_ns
    assert len(set(together.tolist())) == 6
    alone = Swarm(SWARM.groups, 3, KEYS[1:], SWARM.pose[3:])
    assert put_up(event, alone).phase_ns.tolist() == together[3:].tolist()
    assert put_up(event, serial=1).phase_ns.tolist() != together.tolist()
    assert ((together >= 0) & (together < 10**9)).all()


@pytest.mark.parametrize("duty", [0.1, 0.5, 0.9])
def test_it_is_on_for_its_duty_and_toggles_tell_when(duty: float):
    found = put_up(jammer(at=(0.0, 0.0), duty=duty, period_s=0.0007))
    assert found.duty == pytest.approx([duty] * 2, abs=1e-6)
    at_ns = np.arange(0, 2_000_000, 100)
    seen = np.array([found.is_on(one) for one in at_ns.tolist()])
    assert seen.mean(axis=0) == pytest.approx([duty] * 2, abs=0.15)
    now = found.is_on(-1)
    toggled, which = found.toggles(0, 2_000_000)
    assert (np.diff(toggled) >= 0).all()
    for i, time_ns in enumerate(at_ns.tolist()):
        flips = np.bincount(which[toggled <= time_ns], minlength=2)
        np.testing.assert_array_equal(now ^ (flips % 2 == 1), seen[i])


def test_toggles_in_steps_are_those_of_the_whole():
    found = put_up(jammer(at=(0.0, 0.0), duty=0.3, period_s=0.01))
    whole = found.toggles(0, 100_000_000)
    steps = [found.toggles(at_ns, at_ns + 10_000_000) for at_ns in range(0, 100_000_000, 10_000_000)]
    assert np.concatenate([times for times, _ in steps]).tolist() == whole[0].tolist()


def test_one_that_is_always_on_never_toggles():
    found = put_up(jammer(at=(0.0, 0.0)))
    assert found.is_on(123).all()
    assert len(found.toggles(0, 10**9)[0]) == 0


def test_where_nothing_disturbs_a_jammer_is_refused():
    with pytest.raises(BadInput, match=r'^do: expected another radio.access.method than "none"'):
        jammer(at=(0.0, 0.0)).check_radio(Radio(model="log-distance", log_distance=LogDistance()))
