"""Events of a run, and impulses."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Truth
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.robot.packets import ReceivedPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.world.event_scheduler import Effects, EventScheduler
from swarmwire.world.events.selection import Selection, Swarm
from swarmwire.world.live_events import LiveEvents
from swarmwire.world.loop import Loop
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support.world.scenes import changed, posed

TWO = [[-1.0, 0.0, 0.0], [-1.0, 1.0, 0.0]]
ENGINES = ["discs", "pymunk"]


class Watch(Observer):
    """An observer that collects every truth."""

    def __init__(self) -> None:
        self.truths: list[Truth] = []

    def see(self, truth: Truth) -> None:
        self.truths.append(truth)


class ForwardBackend:
    """A backend that drives all robots that act, and collects their rows."""

    def __init__(self, linear_mps: float = 0.1) -> None:
        self.linear_mps = linear_mps
        self.rows: list[list[int]] = []

    def start(self) -> None: ...

    def act(self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses) -> Actions:
        rows = np.concatenate([group.rows for group in readings.values()])
        self.rows.append(rows.tolist())
        n = len(rows)
        return Actions(rows, np.ones(n, np.bool_), np.full(n, self.linear_mps), *np.zeros((2, n)))

    def counts(self) -> dict[str, int]:
        return {}

    def close(self) -> None: ...


def truths_of(
    poses: list[list[float]], events: list[dict[str, Any]], ticks: int = 30, backend: Any = None
) -> list[Truth]:
    watch = Watch()
    scenario = posed(poses, events=events, radio={"range_m": 9.0})
    world = World(scenario, [1], {})
    keys, size_m = world.keys, scenario.arena.size_m
    assert scenario.radio
    obstacles = obstacle_arrays(world.static.obstacles)
    medium = RadioMedium(ChannelContext.open_space(scenario.radio, keys, len(poses), size_m, obstacles), 10)
    Loop(world, medium, backend or ForwardBackend(), [watch], scenario.events).run(ticks)
    return watch.truths


def at(do: str, at_s: float, *names: str, **keys: Any) -> dict[str, Any]:
    return {"do": do, "at_s": at_s, "robots": {"names": list(names)}, **keys}


def test_killed_robot_brakes_and_does_not_act_until_it_is_revived():
    backend = ForwardBackend()
    truths = truths_of(TWO, [at("kill", 0.45, "a-0", for_s=1.0)], backend=backend)
    assert [truth.alive.tolist() for truth in truths] == [[not 5 <= tick < 15, True] for tick in range(30)]
    assert backend.rows == [[1] if 5 <= tick < 15 else [0, 1] for tick in range(30)]
    assert (truths[5].command[0] == 0).all()
    assert np.array_equal(truths[7].pose[0], truths[15].pose[0])
    assert truths[29].pose[0, 0] > truths[15].pose[0, 0] + 0.1
    x = [truth.pose[1, 0] for truth in truths]
    assert x == [truth.pose[1, 0] for truth in truths_of(TWO, [])]


def test_event_takes_effect_at_the_first_tick_at_or_after_its_time():
    for at_s, tick in ((0.0, 0), (0.3, 3), (0.31, 4)):
        truths = truths_of(TWO, [at("kill", at_s, "a-1")], ticks=6)
        [only] = [(truth.tick, happened) for truth in truths for happened in truth.events]
        assert only[0] == tick
        assert (only[1].serial, only[1].at_s, only[1].do, only[1].ended) == (0, at_s, "kill", False)
        assert only[1].changed.tolist() == [False, True]


def test_dead_robot_is_an_obstacle_that_can_be_pushed():
    """The pusher gets less far than alone, and the dead robot is never faster than the pusher."""
    truths = truths_of([[-1.0, 0.0, 0.0], [-0.8, 0.02, 0.0]], [at("kill", 0.0, "a-1")], ticks=60)
    alone = truths_of([[-1.0, 0.0, 0.0], [-0.8, 1.0, 0.0]], [], ticks=60)
    assert sum(truth.contact_onsets[0, 0] for truth in truths) >= 1
    assert truths[-1].pose[0, 0] < alone[-1].pose[0, 0]
    assert max(np.hypot(*truth.velocity[1, :2]) for truth in truths) < 0.11


def test_overlapping_kills_last_until_all_ended_or_a_revive():
    twice = [at("kill", 0.2, "a-0", for_s=0.3), at("kill", 0.3, "a-0", for_s=1.0)]
    assert [not truth.alive[0] for truth in truths_of(TWO, twice, 20)] == [2 <= tick < 13 for tick in range(20)]
    lifted = [*twice, at("revive", 0.8, "a-0")]
    truths = truths_of(TWO, lifted, 20)
    assert [not truth.alive[0] for truth in truths] == [2 <= tick < 8 for tick in range(20)]
    events = [(truth.tick, e.do, e.ended, e.changed.tolist()) for truth in truths for e in truth.events]
    assert events == [
        (2, "kill", False, [True, False]),
        (3, "kill", False, [False, False]),
        (5, "kill", True, [False, False]),
        (8, "revive", False, [True, False]),
        (13, "kill", True, [False, False]),
    ]


def test_events_end_before_others_begin_at_the_same_time():
    truths = truths_of(
        TWO, [at("kill", 0.2, "a-0", for_s=0.3), at("kill", 0.5, "a-0"), at("kill", 0.31, "a-1", for_s=0.02)], 9
    )
    assert [e.changed.tolist() for e in truths[5].events] == [[True, False], [True, False]]
    assert [not truth.alive[0] for truth in truths] == [tick >= 2 for tick in range(9)]
    assert [(e.ended, e.changed.tolist()) for e in truths[4].events] == [(False, [False, True]), (True, [False, True])]
    assert all(truth.alive[1] for truth in truths)


def test_radio_graph_excludes_dead_disabled_and_partitioned_pairs():
    four = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]
    events = [
        at("kill", 0.1, "a-0", for_s=0.1),
        at("blackout", 0.2, "a-1", for_s=0.1),
        {"do": "partition", "at_s": 0.3, "between": [["a-0", "a-1"], ["a-2"]], "for_s": 0.1},
    ]
    edges = [set(map(tuple, truth.edges.tolist())) for truth in truths_of(four, events, 5) if truth.edges is not None]
    everyone = {(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)}
    assert edges == [
        everyone,
        {(1, 2), (1, 3), (2, 3)},
        {(0, 2), (0, 3), (2, 3)},
        everyone - {(0, 2), (1, 2)},
        everyone,
    ]


def test_ramp_changes_the_radio_range_tick_by_tick():
    """Robots 1 m apart; the range falls from 9 m at 0.2 s to 0.5 m at 1.2 s, and is 9 m again at 1.5 s."""
    ramp = {"do": "ramp", "at_s": 0.2, "what": "radio.range_m", "to": 0.5, "over_s": 1.0, "for_s": 1.3}
    truths = truths_of(TWO, [ramp], 20)
    joined = [truth.edges is not None and len(truth.edges) == 1 for truth in truths]
    assert joined == [not 12 <= tick < 15 for tick in range(20)]
    events = [(truth.tick, e.do, e.ended, e.changed.tolist()) for truth in truths for e in truth.events]
    assert events == [(2, "ramp", False, [True, True]), (15, "ramp", True, [True, True])]


def effects(events: list[dict[str, Any]], ticks: int = 20) -> list[Effects]:
    """Effects of events in each tick of a run with two robots and a radio."""
    scenario = posed(TWO, events=events, radio={"range_m": 9.0})
    world = World(scenario, [1], {})
    scheduler = EventScheduler(scenario.events, world.static, world.keys, scenario.radio)
    return [scheduler.apply(tick * 10**8, world) for tick in range(ticks)]


def test_radio_and_disruption_are_replaced_only_when_they_change():
    ramp = {"do": "ramp", "at_s": 0.2, "what": "radio.loss", "to": 0.4, "over_s": 0.4, "for_s": 1.0}
    losses = [each.radio.loss for each in effects([ramp]) if each.radio is not None]
    assert losses == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.0])
    changed = {tick: each.disruption for tick, each in enumerate(effects([at("blackout", 0.2, "a-1", for_s=0.5)]))}
    on = {tick: new.radio_on.tolist() for tick, new in changed.items() if new is not None}
    assert on == {2: [True, False], 7: [True, True]}


def test_partition_by_position_uses_the_positions_at_its_begin():
    """Robot 0 drives across the middle before the second partition begins."""
    halves = {"do": "partition", "halves": "x"}
    events = [{**halves, "at_s": 0.1, "for_s": 1.0}, {**halves, "at_s": 4.0}]
    truths = truths_of([[-0.05, 0.0, 0.0], [-0.5, 1.0, 0.0]], events, 42)
    joined = [truth.edges is not None and len(truth.edges) == 1 for truth in truths]
    assert joined == [tick < 40 for tick in range(42)]


def swarm(*keys: int, robots: int = 10) -> Swarm:
    pose = np.zeros((robots * len(keys), 3))
    return Swarm({"a": range(4), "b": range(4, robots)}, robots, np.array(keys, np.uint64), pose)


def chosen(crowd: Swarm, serial: int = 0, eligible: Any = None, **keys: Any) -> list[list[int]]:
    mask = np.ones(crowd.rows, np.bool_) if eligible is None else eligible
    rows = Selection(**keys).rows(serial, crowd, mask).reshape(-1, crowd.robots)
    return [np.flatnonzero(arena_rows).tolist() for arena_rows in rows]


@pytest.mark.parametrize(
    ("share", "robots", "number"),
    [(0.05, 10, 1), (0.04, 10, 1), (0.15, 10, 2), (0.25, 10, 3), (0.24, 10, 2), (0.145, 100, 15), (1.0, 10, 10)],
)
def test_share_of_robots_is_rounded_half_up_and_at_least_one(share: float, robots: int, number: int):
    assert len(chosen(swarm(7, robots=robots), share=share)[0]) == number


def test_share_counts_eligible_robots_of_the_group():
    eligible = np.array([False, True, True, False, *[True] * 6])
    assert chosen(swarm(7), eligible=eligible, group="a", share=1.0) == [[1, 2]]
    assert chosen(swarm(7), eligible=eligible, group="a", count=5) == [[1, 2]]
    assert chosen(swarm(7), eligible=np.zeros(10, np.bool_), share=0.5) == [[]]
    assert chosen(swarm(7), eligible=eligible, names=("a-0", "b-1")) == [[0, 5]]
    assert chosen(swarm(7), eligible=eligible, group="a") == [[0, 1, 2, 3]]


def test_selection_is_drawn_for_each_arena_and_event():
    """Other seeds and events draw other robots; an arena draws the same robots alone and among others."""
    many = swarm(*range(8), robots=40)
    drawn = chosen(many, count=10)
    assert [chosen(swarm(key, robots=40), count=10)[0] for key in range(8)] == drawn
    assert len({tuple(robots) for robots in drawn}) == 8
    assert chosen(many, serial=1, count=10)[0] != drawn[0]


def test_failures_are_recorded_at_their_times_at_a_rate_and_else_at_the_scenarios():
    rate = at("fail", 0.4, "a-0", "a-1", part="motors", per_hour=3000.0, for_s=0.5)
    events = [(truth, happened) for truth in truths_of(TWO, [rate]) for happened in truth.events]
    assert {happened.words for _, happened in events} == {"fail motors", "fail motors ended"}
    assert all(happened.singly and happened.changed.any() for _, happened in events)
    assert all(happened.at_s == truth.time_ns / 1e9 >= 0.4 for truth, happened in events)
    single = at("fail", 0.45, "a-1", part="compass")
    events = [happened for truth in truths_of(TWO, [single]) for happened in truth.events]
    assert [(happened.at_s, happened.words, happened.singly) for happened in events] == [(0.45, "fail compass", False)]


def pushed(
    poses: Any, engine: str, ticks: int = 20, body: str = "footbot", speed_mps: float = 0.4, **keys: Any
) -> Watch:
    """Robots at rest of which an event pushes the first in tick 2."""
    event = {"do": "impulse", "at_s": 0.2, "robots": {"names": ["a-0"]}, "speed_mps": speed_mps, **keys}
    scenario = posed(poses, body, events=[event], physics={"engine": engine})
    watch = Watch()
    Loop(World(scenario, [1], {}), None, ForwardBackend(0.0), [watch], scenario.events).run(ticks)
    return watch


@pytest.mark.parametrize("engine", ENGINES)
def test_impulse_sets_a_velocity_that_motors_brake(engine):
    truths = pushed([[0.0, 0.0, 0.3], [1.0, 0.0, 0.0]], engine, direction_rad=np.pi / 2).truths
    assert np.allclose(truths[1].velocity, 0.0)
    assert np.allclose(truths[2].velocity[0], [0.0, 0.4, 0.0], atol=1e-12)
    assert not truths[2].velocity[1].any()
    [happened] = truths[2].events
    assert (happened.do, happened.ended, happened.changed.tolist()) == ("impulse", False, [True, False])
    assert truths[-1].pose[0, 1] > 0.0005
    assert np.allclose(truths[-1].velocity, 0.0, atol=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_impulses_of_one_tick_add_up_for_all_robots_of_a_group(engine):
    events = [
        {"do": "impulse", "at_s": 0.0, "robots": {"group": "a"}, "speed_mps": speed, "direction_rad": direction}
        for speed, direction in ((0.3, 0.0), (0.1, np.pi))
    ]
    poses = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    scenario = posed(poses, "footbot", events=events, physics={"engine": engine})
    watch = Watch()
    Loop(World(scenario, [1], {}), None, ForwardBackend(0.0), [watch], scenario.events).run(1)
    assert np.allclose(watch.truths[0].velocity, [[0.2, 0.0, 0.0]] * 2)


@pytest.mark.parametrize("engine", ENGINES)
def test_impulse_at_its_limit_passes_no_wall_and_no_robot(engine):
    """The limit is a radius per physics step: 0.085 m in 0.02 s."""
    truths = pushed([[1.8, 0.0, 0.0], [1.0, 0.0, 0.0]], engine, speed_mps=4.25).truths
    assert max(truth.pose[0, 0] for truth in truths) < 2.0
    assert sum(truth.contact_onsets[0, 1] for truth in truths) >= 1
    truths = pushed([[-1.0, 0.0, 0.0], [-0.8, 0.0, 0.0]], engine, speed_mps=4.25).truths
    assert all(truth.pose[0, 0] < truth.pose[1, 0] for truth in truths)
    assert sum(truth.contact_onsets[0, 0] for truth in truths) >= 1


def test_impulse_is_refused_for_bodies_without_contacts():
    event = {"do": "impulse", "at_s": 0.2, "robots": {"group": "flock"}, "speed_mps": 0.4}
    mapping = changed("events", [event])
    mapping["physics"] = {"engine": "kinematic"}
    with pytest.raises(BadInput, match="events.0.robots: expected robots whose bodies have contacts"):
        scenario_from(mapping, "s.toml")
    world = World(posed([[0.0, 0.0, 0.0]], physics={"engine": "kinematic"}), [1], {})
    with pytest.raises(TypeError, match="knows no forces"):
        world.apply_impulse(np.ones((1, 2)))


def test_impulse_acts_only_in_the_engine_with_forces():
    mapping = changed("physics", {"engine": "auto"})
    mapping["robots"]["big"]["body"] = "point"
    mapping["events"] = [{"do": "impulse", "at_s": 0.0, "robots": {"names": ["flock-2"]}, "speed_mps": 0.4}]
    scenario = scenario_from(mapping, "s.toml")
    world, watch = World(scenario, [1], {}), Watch()
    assert set(world.engines) == {"discs", "kinematic"}
    Loop(world, None, ForwardBackend(0.0), [watch], scenario.events, live_events=LiveEvents(scenario, {})).run(2)
    assert watch.truths[0].velocity[:, 0].tolist() == [0.4 if row == 2 else 0.0 for row in range(15)]
