"""Events of a scenario: partitions, radio events, and events of robots."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns, to_ns
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.radio.config.impairments import Bursts, Measures, RangeMeasure
from swarmwire.comms.radio.config.path_loss_models import LogDistance
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.config.ramps import number_of
from swarmwire.comms.radio.context import in_space
from swarmwire.comms.radio.disruption import ALL, DROP, NEWEST, Jammers
from swarmwire.world.events.effects import ActiveEffects
from swarmwire.world.events.event import as_toml
from swarmwire.world.events.partition import Partition, PartitionRegion
from swarmwire.world.events.radio_events import Blackout, Gain, Jammer, Ramp
from swarmwire.world.events.robot_events import Fail, Revive
from swarmwire.world.events.selection import Selection, Swarm
from tests.support.comms.radio import RATE_HZ, WIFI_B, Run, at, everybody, make_medium

# Robots a-0 to a-3 and b-0 to b-1, all in reach of one another.
POSE = at((-1, 0.5), (-0.5, -0.5), (-0.2, 0.3), (0.3, -0.2), (0.6, 0.7), (1, -0.7))
SWARM = Swarm({"a": range(4), "b": range(4, 6)}, 6, np.array([7], np.uint64), POSE)
EVERYBODY = {0, 1, 2, 3, 4, 5}
SCRIPTS: list[tuple[dict[str, Any], list[set[int]]]] = [
    ({"between": (("a",), ("b",))}, [{0, 1, 2, 3}, {4, 5}]),
    ({"between": (("a-0", "a-1"), ("a-2", "a-3"), ("b",))}, [{0, 1}, {2, 3}, {4, 5}]),
    ({"halves": "x"}, [{0, 1, 2}, {3, 4, 5}]),
    ({"halves": "y"}, [{1, 3, 5}, {0, 2, 4}]),
    ({"isolate": ("a-2",)}, [{2}, EVERYBODY - {2}]),
    ({"isolate": ("b", "a-0")}, [{4}, {5}, {0}, {1, 2, 3}]),
    ({"isolate": ("a", "b")}, [{robot} for robot in EVERYBODY]),
    ({"region": PartitionRegion(radius_m=0.6)}, [{2, 3}, {0, 1, 4, 5}]),
    ({"region": PartitionRegion(at=(1.0, 0.0), size_m=(1.0, 2.0))}, [{4, 5}, {0, 1, 2, 3}]),
]
KEYS = np.array([7, 8], np.uint64)
APART = Swarm({"a": range(3)}, 3, KEYS, np.arange(18.0).reshape(6, 3))
RADIO = Radio(2.0, loss=0.1, bursts=Bursts(), measures=Measures(range=RangeMeasure(0.01)))
ROBOTS = 2000


def swarm(*keys: int, robots: int = ROBOTS) -> Swarm:
    return Swarm({"a": range(robots)}, robots, np.array(keys, np.uint64), np.zeros((len(keys) * robots, 3)))


def partition(**keys: Any) -> Partition:
    return Partition(at_s=0.0, **keys)


def started(event: Partition, swarm: Swarm = SWARM) -> ActiveEffects:
    conditions = ActiveEffects(swarm.rows)
    event.check(swarm.groups)
    event.begin(0, swarm, conditions)
    return conditions


def broadcasts(conditions: ActiveEffects, pose: FloatArray = POSE) -> Run:
    """A run in which each robot broadcasts once under these conditions."""
    medium = make_medium(Radio(9.0, send_offset="tick"), len(pose))
    run = Run(medium)
    for tick in range(3):
        run.news.append(medium.step(tick_start_ns(tick, RATE_HZ), pose, conditions.disruption()))
        if tick == 1:
            medium.send(tick_start_ns(tick, RATE_HZ), tick, everybody(len(pose))(tick))
    run.last = medium.end()
    return run


def islands(edges: IntArray, robots: int) -> set[frozenset[int]]:
    """The connected components of a graph of pairs."""
    island = {robot: frozenset({robot}) for robot in range(robots)}
    for a, b in edges.tolist():
        both = island[a] | island[b]
        island.update(dict.fromkeys(both, both))
    return set(island.values())


def received_pairs(run: Run) -> set[tuple[int, int]]:
    return set(zip(run.received("sender_index").tolist(), run.received("receiver").tolist(), strict=True))


@pytest.mark.parametrize(("keys", "sets"), SCRIPTS)
def test_partition_has_the_listed_sets_and_no_packet_crosses_until_its_end(keys: dict[str, Any], sets: list[set[int]]):
    event = partition(**keys, for_s=1.0)
    conditions = started(event)
    run = broadcasts(conditions)
    assert islands(run.edges, 6) == {frozenset(members) for members in sets}
    assert received_pairs(run) == {(a, b) for members in sets for a in members for b in members if a != b}
    received = sum(len(members) * (len(members) - 1) for members in sets)
    assert run.fates() == {fate: n for fate, n in (("RECEIVED", received), ("PARTITIONED", 30 - received)) if n}
    event.end(0, conditions)
    assert broadcasts(conditions).fates() == {"RECEIVED": 30}


def test_partition_bridge_hears_all_and_connects_the_halves():
    for keys, halves in (
        ({"bridge": ("a-2", "b-1")}, ({0, 1}, {3, 4})),
        ({"bridge": ("a-2",)}, ({0, 1, 3}, {4, 5})),
        ({"bridge": ("a-2", "b-1"), "halves": "y"}, ({1, 3}, {0, 4})),
    ):
        run = broadcasts(started(partition(**keys)))
        crossing = {(a, b) for a in halves[0] for b in halves[1]}
        crossing |= {(b, a) for a, b in crossing}
        assert received_pairs(run) == {(a, b) for a in range(6) for b in range(6) if a != b} - crossing
        assert islands(run.edges, 6) == {frozenset(EVERYBODY)}


@pytest.mark.parametrize(
    ("keys", "first"),
    [
        ({"between": (("b",), ("a",))}, {4, 5}),
        ({"halves": "x"}, {0, 1, 2}),
        ({"region": PartitionRegion(radius_m=0.6)}, {2, 3}),
    ],
)
def test_partition_one_way_stops_packets_from_the_first_set_alone(keys: dict[str, Any], first: set[int]):
    run = broadcasts(started(partition(**keys, one_way=True)))
    second = EVERYBODY - first
    unheard = {(a, b) for a in first for b in second}
    assert received_pairs(run) == {(a, b) for a in range(6) for b in range(6) if a != b} - unheard
    assert run.fates() == {"RECEIVED": 30 - len(unheard), "PARTITIONED": len(unheard)}
    assert islands(run.edges, 6) == {frozenset(first), frozenset(second)}


def test_partition_by_position_is_computed_once_for_each_arena():
    two = Swarm(SWARM.groups, 6, np.array([7, 8], np.uint64), np.concatenate([POSE, -POSE]))
    conditions = started(partition(halves="x"), two)
    assert conditions.disruption().sides.tolist() == [[1, 1, 1, 2, 2, 2, 2, 2, 2, 1, 1, 1]]


def test_partition_region_contains_its_edge():
    pose = at((1, 0), (1.01, 0), (0, -2), (0, -2.01))
    assert PartitionRegion(radius_m=1.0).contains(pose).tolist() == [True, False, False, False]
    assert PartitionRegion(size_m=(2.0, 4.0)).contains(pose).tolist() == [True, False, True, False]


def blackout(*names: str, **backlog: str) -> Blackout:
    return Blackout(at_s=0.0, robots=Selection(names=names), **backlog)


def test_blackout_with_the_strictest_backlog_applies_until_it_ends():
    conditions = ActiveEffects(3)
    default = blackout("a-2")  # drops
    events = [blackout("a-0", "a-1", backlog="all"), blackout("a-1", "a-2", backlog="newest"), default]
    for serial, event in enumerate(events):
        event.begin(serial, swarm(7, robots=3), conditions)
    assert conditions.disruption().active_backlog.tolist() == [ALL, NEWEST, DROP]
    events[2].end(2, conditions)
    assert conditions.disruption().active_backlog.tolist() == [ALL, NEWEST, NEWEST]
    events[1].end(1, conditions)
    assert conditions.disruption().active_backlog.tolist() == [ALL, ALL, DROP]
    assert conditions.radio_on.tolist() == [False, False, True]


def gain(*names: str, **keys: Any) -> Gain:
    return Gain(at_s=0.0, robots=Selection(names=names), for_s=1.0, **keys)


def test_gains_of_events_add_up_by_direction_in_every_arena():
    conditions, events = ActiveEffects(6), [gain("a-0", "a-1", send_db=-6.0), gain("a-1", send_db=2.0, receive_db=-3.0)]
    changed = [event.begin(serial, swarm(7, 8, robots=3), conditions).tolist() for serial, event in enumerate(events)]
    assert changed == [[True, True, False] * 2, [False, True, False] * 2]
    now = conditions.disruption()
    assert now.send_gain_db.tolist() == [-6.0, -4.0, 0.0] * 2
    assert now.receive_gain_db.tolist() == [0.0, -3.0, 0.0] * 2
    assert events[0].end(0, conditions).tolist() == [True, True, False] * 2
    now = conditions.disruption()
    assert now.send_gain_db.tolist() == [0.0, 2.0, 0.0] * 2
    events[1].end(1, conditions)
    assert not conditions.disruption().send_gain_db.any()


def jammer(**keys: Any) -> Jammer:
    return Jammer(at_s=0.0, power_dbm=10.0, for_s=1.0, **keys)


def started_jammers(event: Jammer, swarm: Swarm = APART, serial: int = 0) -> Jammers:
    conditions = ActiveEffects(swarm.rows)
    event.begin(serial, swarm, conditions)
    return conditions.disruption().jammers


@pytest.mark.parametrize(
    ("where", "carriers", "at_m"),
    [
        ({"at": (1.0, -2.0)}, [NO_ROBOT, NO_ROBOT], [[1.0, -2.0, 0.0]] * 2),
        ({"robots": Selection(names=("a-1",))}, [1, 4], [[3.0, 4.0, 0.0], [12.0, 13.0, 0.0]]),
    ],
)
def test_jammer_is_at_its_position_or_carrier_in_every_arena(where: Any, carriers: list[int], at_m: list[list[float]]):
    jammers = started_jammers(jammer(**where))
    assert jammers.arena.tolist() == [0, 1]
    assert jammers.carrier.tolist() == carriers
    assert jammers.positions(in_space(APART.pose)).tolist() == at_m


def test_jammers_of_several_events_add_up_and_end_one_by_one():
    conditions = ActiveEffects(6)
    standing, carried = jammer(at=(0.0, 0.0)), jammer(robots=Selection(count=2))
    assert standing.begin(0, APART, conditions).all()
    chosen = carried.begin(1, APART, conditions)
    assert chosen.reshape(2, 3).sum(axis=1).tolist() == [2, 2]
    assert len(conditions.disruption().jammers.arena) == 6
    assert standing.end(0, conditions).all()
    assert carried.end(1, conditions).tolist() == chosen.tolist()
    assert len(conditions.disruption().jammers.arena) == 0


def test_jammer_phase_differs_by_arena_and_jammer():
    event = jammer(robots=Selection(group="a"), duty=0.5, period_s=1.0)
    together = started_jammers(event).phase_ns
    assert len(set(together.tolist())) == 6
    alone = Swarm(APART.groups, 3, KEYS[1:], APART.pose[3:])
    assert started_jammers(event, alone).phase_ns.tolist() == together[3:].tolist()
    assert started_jammers(event, serial=1).phase_ns.tolist() != together.tolist()
    assert ((together >= 0) & (together < 10**9)).all()


@pytest.mark.parametrize("duty", [0.1, 0.5, 0.9, 1.0])
def test_jammer_is_on_for_its_duty_and_toggles_at_both_ends(duty: float):
    jammers = started_jammers(jammer(at=(0.0, 0.0), duty=duty, period_s=0.0007))
    assert jammers.duty == pytest.approx([duty] * 2, abs=1e-6)
    at_ns = np.arange(0, 2_000_000, 400)
    is_on = np.array([jammers.is_on(time_ns) for time_ns in at_ns.tolist()])
    assert is_on.mean(axis=0) == pytest.approx([duty] * 2, abs=0.15)
    now = jammers.is_on(-1)
    toggled, which = jammers.toggles(0, 2_000_000)
    assert (np.diff(toggled) >= 0).all()
    assert (len(toggled) == 0) == (duty == 1.0)
    for i, time_ns in enumerate(at_ns.tolist()):
        flips = np.bincount(which[toggled <= time_ns], minlength=2)
        np.testing.assert_array_equal(now ^ (flips % 2 == 1), is_on[i])


def test_jammer_toggles_are_the_same_in_steps_and_at_once():
    jammers = started_jammers(jammer(at=(0.0, 0.0), duty=0.3, period_s=0.01))
    at_once = jammers.toggles(0, 100_000_000)
    steps = [jammers.toggles(at_ns, at_ns + 10_000_000) for at_ns in range(0, 100_000_000, 10_000_000)]
    assert np.concatenate([times for times, _ in steps]).tolist() == at_once[0].tolist()


def test_jammer_is_refused_for_a_radio_without_interference():
    with pytest.raises(BadInput, match=r'^do: expected another radio.access.method than "none"'):
        jammer(at=(0.0, 0.0)).check_radio(Radio(model="log-distance", log_distance=LogDistance()))


def started_ramps(*ramps: Ramp) -> ActiveEffects:
    conditions = ActiveEffects(2)
    for serial, ramp in enumerate(ramps):
        ramp.check_radio(RADIO)
        assert ramp.begin(serial, swarm(7, robots=2), conditions).all()
    return conditions


def numbers(conditions: ActiveEffects, key: str, *at_s: float) -> list[float]:
    return [number_of(conditions.radio_at(RADIO, to_ns(time_s)), key) for time_s in at_s]


def ramp(key: str, to: float, at_s: float = 1.0, **keys: Any) -> Ramp:
    return Ramp(at_s=at_s, what=key, to=to, **keys)


@pytest.mark.parametrize(
    ("event", "expected"),  # by time in s
    [
        (ramp("radio.loss", 0.5, over_s=4.0), {1.0: 0.1, 2.0: 0.2, 3.0: 0.3, 5.0: 0.5, 9.0: 0.5}),
        (ramp("radio.range_m", 1.5), {1.0: 1.5, 1.1: 1.5}),
        (ramp("radio.queue_limit", 0.0, over_s=8.0), {1.0: 20, 2.0: 18, 2.1: 17, 9.0: 0}),
    ],
)
def test_ramp_is_linear_rounds_whole_numbers_and_keeps_its_final_value(event: Ramp, expected: dict[float, float]):
    conditions = started_ramps(event)
    reached = numbers(conditions, event.what, *expected)
    assert reached == pytest.approx(list(expected.values()))
    assert reached[-1] == event.to
    assert isinstance(conditions.radio_at(RADIO, to_ns(2.1)).queue_limit, int)


def test_ramp_changes_a_number_within_a_table_alone():
    conditions = started_ramps(ramp("radio.measures.range.noise_m", 0.5), ramp("radio.bursts.bad_s", 2.0))
    bursts, measures = Bursts(bad_s=2.0), Measures(range=RangeMeasure(0.5))
    assert conditions.radio_at(RADIO, to_ns(1.0)) == replace(RADIO, bursts=bursts, measures=measures)


def test_ramp_starts_at_the_value_of_earlier_ramps_and_is_undone_to_it():
    first, second = ramp("radio.loss", 0.3), ramp("radio.loss", 0.9, at_s=2.0, over_s=2.0)
    conditions = started_ramps(first, second)
    assert numbers(conditions, "radio.loss", 2.0, 3.0, 4.0) == pytest.approx([0.3, 0.6, 0.9])
    second.end(1, conditions)
    assert numbers(conditions, "radio.loss", 4.0) == [0.3]
    first.end(0, conditions)
    assert conditions.radio_at(RADIO, to_ns(4.0)) is RADIO


def test_ramp_to_a_bit_rate_of_a_standard_must_be_a_step():
    ramp("radio.bit_rate_bps", 2_000_000).check_radio(WIFI_B)
    with pytest.raises(BadInput, match=r"^over_s: radio\..*: .*1000000, 2000000.*got 1500000 bit/s"):
        ramp("radio.bit_rate_bps", 2_000_000, over_s=1.0).check_radio(WIFI_B)
    with pytest.raises(BadInput, match=r"^to: radio\..*got 3000000 bit/s"):
        ramp("radio.bit_rate_bps", 3_000_000).check_radio(WIFI_B)


def fail(part: str, *, per_hour: float | None = None, for_s: float | None = None, **robots: float) -> Fail:
    chosen = Selection(group="a", **robots)  # pyright: ignore[reportArgumentType] - share or count
    return Fail(at_s=10.0, part=part, robots=chosen, per_hour=per_hour, for_s=for_s)


def failed_after(event: Fail, crowd: Swarm, *at_s: float) -> list[np.ndarray]:
    """Mask of the robots whose part has failed, at these times."""
    conditions, failed = ActiveEffects(crowd.rows), []
    event.begin(0, crowd, conditions)
    for time_s in at_s:
        event.advance(0, to_ns(time_s), crowd, conditions)
        failed.append(conditions.failed(event.part))
    return failed


def test_failure_of_a_share_of_robots_starts_at_once_and_ends():
    conditions, crowd, event = ActiveEffects(10), swarm(7, robots=10), fail("proximity", share=0.3, for_s=5.0)
    assert event.duration_s == 5.0
    changed = event.begin(0, crowd, conditions)
    assert changed.sum() == 3
    assert (conditions.failed_parts["proximity"] == changed).all()
    assert conditions.alive.all()
    assert (event.end(0, conditions) == changed).all()
    assert not conditions.failed_parts


def test_failure_by_two_events_ends_with_the_later():
    conditions, crowd, event = ActiveEffects(4), swarm(7, robots=4), fail("motors")
    event.begin(0, crowd, conditions)
    assert not event.begin(1, crowd, conditions).any()
    assert not event.end(0, conditions).any()
    assert event.end(1, conditions).all()


def test_failure_rate_gives_exponential_lifetimes():
    # An hour at 2 per hour leaves exp(-2) of the robots; three standard errors of a share of 2,000.
    for hours in (0.25, 1.0):
        (failed,) = failed_after(fail("motors", per_hour=2.0), swarm(7), 10.0 + 3600.0 * hours)
        expected = 1.0 - np.exp(-2.0 * hours)
        assert abs(failed.mean() - expected) < 3.0 * np.sqrt(expected * (1.0 - expected) / ROBOTS)


def test_failure_rate_and_duration_give_the_share_of_time_failed():
    # Up for 1/rate on average, down for for_s: of 30 min and 10 min, a quarter of the time is down.
    times_s = 10.0 + 3600.0 * np.arange(2, 12)
    down = failed_after(fail("motors", per_hour=2.0, for_s=600.0), swarm(7), *times_s)
    assert abs(np.mean(down) - 0.25) < 3.0 * np.sqrt(0.25 * 0.75 / ROBOTS)


def test_failure_times_depend_neither_on_ticks_nor_on_other_arenas():
    event = fail("motors", per_hour=60.0, for_s=20.0)
    often = failed_after(event, swarm(7), *(10.0 + 0.1 * np.arange(1, 1201)))[-1]
    (seldom,) = failed_after(event, swarm(7), 130.0)
    (second_arena,) = failed_after(event, swarm(9, 7), 130.0)
    assert often.any()
    assert (often == seldom).all()
    assert (second_arena[ROBOTS:] == seldom).all()


def test_battery_failure_kills_until_recovery_or_revival():
    conditions, crowd, event = ActiveEffects(6), swarm(7, robots=6), fail("battery", count=4)
    event.begin(0, crowd, conditions)
    assert conditions.alive.sum() == 2
    Revive(at_s=11.0, robots=Selection(names=("a-0", "a-1", "a-2", "a-3", "a-4", "a-5"))).begin(1, crowd, conditions)
    assert conditions.alive.all()
    event.end(0, conditions)
    assert conditions.alive.all()


@pytest.mark.parametrize("part", ["battery", "motors"])
def test_failure_rate_starts_with_all_parts_working(part: str):
    conditions, crowd = ActiveEffects(ROBOTS), swarm(7)
    event = fail(part, per_hour=1000.0)
    assert event.duration_s is None
    assert not event.begin(0, crowd, conditions).any()
    began, ended = event.advance(0, to_ns(20.0), crowd, conditions)
    assert began.any()
    assert not ended.any()
    assert (conditions.alive == ~began).all() if part == "battery" else conditions.alive.all()


def test_battery_at_a_failure_rate_may_fail_again_after_revival():
    conditions, crowd = ActiveEffects(ROBOTS), swarm(7)
    event, everybody = fail("battery", per_hour=1000.0), Revive(at_s=20.0, robots=Selection(group="a"))
    event.begin(0, crowd, conditions)
    first, _ = event.advance(0, to_ns(20.0), crowd, conditions)
    everybody.begin(1, crowd, conditions)
    assert conditions.alive.all()
    again, mended = event.advance(0, to_ns(20.0), crowd, conditions)
    assert not again.any()
    assert (mended == first).all()
    later, _ = event.advance(0, to_ns(60.0), crowd, conditions)
    assert (later & first).any()


def test_battery_failures_of_two_events_kill_until_both_have_ended():
    conditions, crowd = ActiveEffects(ROBOTS), swarm(7)
    first, second = fail("battery", per_hour=60.0, for_s=20.0), fail("battery", per_hour=60.0, for_s=35.0)
    first.begin(0, crowd, conditions)
    second.begin(1, crowd, conditions)
    for time_s in 10.0 + 5.0 * np.arange(1, 61):
        first.advance(0, to_ns(time_s), crowd, conditions)
        second.advance(1, to_ns(time_s), crowd, conditions)
        assert (conditions.alive == ~conditions.failed("battery")).all()
    assert (conditions.failures[0].failed & conditions.failures[1].failed).any()
    still_failed = conditions.failures[1].failed.copy()
    first.end(0, conditions)
    assert (conditions.alive == ~still_failed).all()


def test_battery_gauge_works_after_revival():
    conditions, crowd = ActiveEffects(4), swarm(7, robots=4)
    fail("battery").begin(0, crowd, conditions)
    Revive(at_s=11.0, robots=Selection(names=("a-1",))).begin(1, crowd, conditions)
    assert conditions.failed("battery").tolist() == [True, False, True, True]


def test_event_that_is_permanent_or_constant_refuses_end_and_advance() -> None:
    revive = Revive(at_s=1.0, robots=Selection(group="a"))
    with pytest.raises(TypeError, match="revive is permanent and cannot be undone"):
        revive.end(0, ActiveEffects(2))
    with pytest.raises(TypeError, match="ramp does not change over time"):
        Ramp(at_s=1.0, what="radio.loss", to=0.5).advance(0, 0, swarm(7, robots=2), ActiveEffects(2))


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (True, "true"),
        (False, "false"),
        ("a", '"a"'),
        (0.5, "0.5"),
        ((1, "a"), '[1, "a"]'),
        (Selection(names=("a-0", "a-1")), '{ names = ["a-0", "a-1"] }'),
    ],
)
def test_event_values_are_formatted_as_toml(value: object, words: str) -> None:
    assert as_toml(value) == words
