"""Blackouts, gains, jammers and ramps: what they do to a radio, adding up and undone one by one."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.clock import to_ns
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.effects import ActiveEffects
from swarmwire.comms.events.radio_events import Blackout, Gain, Jammer, Ramp
from swarmwire.comms.events.selection import Selection, Swarm
from swarmwire.comms.radio.config.impairments import Bursts, Measures, RangeMeasure
from swarmwire.comms.radio.config.path_loss_models import LogDistance
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.config.ramps import number_of
from swarmwire.comms.radio.disruption import ALL, DROP, NEWEST, NO_ROBOTS, Jammers
from tests.support.comms.radio.phy.radios import WIFI_B

SWARM = Swarm({"a": range(3)}, 3, np.array([7], np.uint64), np.zeros((3, 3)))


def blackout(backlog: str, *names: str) -> Blackout:
    return Blackout(at_s=0.0, robots=Selection(names=names), backlog=backlog)


def test_the_strictest_backlog_counts_as_long_as_its_blackout_lasts():
    conditions = ActiveEffects(3)
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


TWO_ARENAS = Swarm({"a": range(3)}, 3, np.array([7, 8], np.uint64), np.zeros((6, 3)))


def gain(*names: str, **keys: Any) -> Gain:
    return Gain(at_s=0.0, robots=Selection(names=names), for_s=1.0, **keys)


def test_gains_add_up_each_way_in_every_arena():
    conditions, events = ActiveEffects(6), [gain("a-0", "a-1", send_db=-6.0), gain("a-1", send_db=2.0, receive_db=-3.0)]
    changed = [event.begin(serial, TWO_ARENAS, conditions).tolist() for serial, event in enumerate(events)]
    assert changed == [[True, True, False] * 2, [False, True, False] * 2]
    now = conditions.disruption()
    assert now.send_gain_db.tolist() == [-6.0, -4.0, 0.0] * 2
    assert now.receive_gain_db.tolist() == [0.0, -3.0, 0.0] * 2
    assert events[0].end(0, conditions).tolist() == [True, True, False] * 2
    now = conditions.disruption()
    assert now.send_gain_db.tolist() == [0.0, 2.0, 0.0] * 2
    events[1].end(1, conditions)
    assert not conditions.disruption().send_gain_db.any()


KEYS = np.array([7, 8], np.uint64)
APART = Swarm({"a": range(3)}, 3, KEYS, np.arange(18.0).reshape(6, 3))


def jammer(**keys: Any) -> Jammer:
    return Jammer(at_s=0.0, power_dbm=10.0, for_s=1.0, **keys)


def put_up(event: Jammer, swarm: Swarm = APART, serial: int = 0) -> Jammers:
    conditions = ActiveEffects(swarm.rows)
    event.begin(serial, swarm, conditions)
    return conditions.disruption().jammers


def test_one_stands_at_its_place_in_every_arena():
    found = put_up(jammer(at=(1.0, -2.0)))
    assert found.arena.tolist() == [0, 1]
    assert found.carrier.tolist() == [NO_ROBOTS, NO_ROBOTS]
    assert found.places(APART.pose).tolist() == [[1.0, -2.0]] * 2


def test_one_that_is_carried_is_where_its_robot_is():
    found = put_up(jammer(robots=Selection(names=("a-1",))))
    assert found.arena.tolist() == [0, 1]
    assert found.carrier.tolist() == [1, 4]
    assert found.places(APART.pose).tolist() == [[3.0, 4.0], [12.0, 13.0]]


def test_those_of_several_events_add_up_and_go_one_by_one():
    conditions = ActiveEffects(6)
    standing, carried = jammer(at=(0.0, 0.0)), jammer(robots=Selection(count=2))
    assert standing.begin(0, APART, conditions).all()
    chosen = carried.begin(1, APART, conditions)
    assert chosen.reshape(2, 3).sum(axis=1).tolist() == [2, 2]
    assert len(conditions.disruption().jammers.arena) == 6
    assert standing.end(0, conditions).all()
    assert carried.end(1, conditions).tolist() == chosen.tolist()
    assert len(conditions.disruption().jammers.arena) == 0


def test_the_phase_is_the_arenas_own_and_each_jammers():
    event = jammer(robots=Selection(group="a"), duty=0.5, period_s=1.0)
    together = put_up(event).phase_ns
    assert len(set(together.tolist())) == 6
    alone = Swarm(APART.groups, 3, KEYS[1:], APART.pose[3:])
    assert put_up(event, alone).phase_ns.tolist() == together[3:].tolist()
    assert put_up(event, serial=1).phase_ns.tolist() != together.tolist()
    assert ((together >= 0) & (together < 10**9)).all()


@pytest.mark.parametrize("duty", [0.1, 0.5, 0.9])
def test_it_is_on_for_its_duty_and_toggles_tell_when(duty: float):
    found = put_up(jammer(at=(0.0, 0.0), duty=duty, period_s=0.0007))
    assert found.duty == pytest.approx([duty] * 2, abs=1e-6)
    at_ns = np.arange(0, 2_000_000, 400)
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


RADIO = Radio(2.0, loss=0.1, bursts=Bursts(), measures=Measures(range=RangeMeasure(0.01)))
PAIR = Swarm({"a": range(2)}, 2, np.array([7], np.uint64), np.zeros((2, 3)))


def under(*ramps: Ramp) -> ActiveEffects:
    conditions = ActiveEffects(2)
    for serial, ramp in enumerate(ramps):
        ramp.check_radio(RADIO)
        assert ramp.begin(serial, PAIR, conditions).all()
    return conditions


def numbers(conditions: ActiveEffects, key: str, *at_s: float) -> list[float]:
    return [number_of(conditions.radio_at(RADIO, to_ns(one)), key) for one in at_s]


def ramp(what: str, to: float, at_s: float = 1.0, **keys: Any) -> Ramp:
    return Ramp(at_s=at_s, what=what, to=to, **keys)


def test_a_number_moves_evenly_and_stays_at_its_end():
    loss = numbers(under(ramp("radio.loss", 0.5, over_s=4.0)), "radio.loss", 1.0, 2.0, 3.0, 5.0, 9.0)
    assert loss == pytest.approx([0.1, 0.2, 0.3, 0.5, 0.5])
    assert loss[-1] == 0.5


def test_without_a_time_it_steps():
    assert numbers(under(ramp("radio.range_m", 1.5)), "radio.range_m", 1.0, 1.1) == [1.5, 1.5]


def test_whole_numbers_are_rounded_on_the_way():
    conditions = under(ramp("radio.queue_limit", 0.0, over_s=8.0))
    assert numbers(conditions, "radio.queue_limit", 1.0, 2.0, 2.1, 9.0) == [20, 18, 17, 0]
    assert isinstance(conditions.radio_at(RADIO, to_ns(2.1)).queue_limit, int)


def test_numbers_within_tables_move_and_nothing_else_does():
    conditions = under(ramp("radio.measures.range.noise_m", 0.5), ramp("radio.bursts.bad_s", 2.0))
    bursts, measures = Bursts(bad_s=2.0), Measures(range=RangeMeasure(0.5))
    assert conditions.radio_at(RADIO, to_ns(1.0)) == replace(RADIO, bursts=bursts, measures=measures)


def test_a_ramp_sets_out_from_what_those_before_it_made_and_undone_leaves_that():
    first, second = ramp("radio.loss", 0.3), ramp("radio.loss", 0.9, at_s=2.0, over_s=2.0)
    conditions = under(first, second)
    assert numbers(conditions, "radio.loss", 2.0, 3.0, 4.0) == pytest.approx([0.3, 0.6, 0.9])
    second.end(1, conditions)
    assert numbers(conditions, "radio.loss", 4.0) == [0.3]
    first.end(0, conditions)
    assert conditions.radio_at(RADIO, to_ns(4.0)) is RADIO


def test_a_bit_rate_that_a_standard_has_may_be_stepped_to_but_not_ramped():
    ramp("radio.bit_rate_bps", 2_000_000).check_radio(WIFI_B)
    with pytest.raises(BadInput, match=r"^over_s: radio\..*: .*1000000, 2000000.*got 1500000 bit/s"):
        ramp("radio.bit_rate_bps", 2_000_000, over_s=1.0).check_radio(WIFI_B)
    with pytest.raises(BadInput, match=r"^to: radio\..*got 3000000 bit/s"):
        ramp("radio.bit_rate_bps", 3_000_000).check_radio(WIFI_B)
