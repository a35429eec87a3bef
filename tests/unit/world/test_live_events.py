"""Events given while a run goes on: checked as those of its scenario, taken once, under numbers of their own."""

from typing import Any

import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.world.events.robot_events import Kill
from swarmwire.world.live_events import MAX_WAITING, LiveEvent, LiveEvents
from swarmwire.world.loop import Loop
from swarmwire.world.scenario.bodies import bodies_of
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support.world.scenes import changed, posed
from tests.unit.world.test_event_scheduler import Ahead, Watch

RATE_HZ = 10
KILL: dict[str, Any] = {"do": "kill", "robots": {"names": ["flock-1"]}}
SET: dict[str, Any] = {"do": "ramp", "what": "radio.loss", "to": 0.5}
OF_SCENARIO = [
    {"at_s": 1.0, "do": "kill", "robots": {"group": "flock"}},
    {"at_s": 2.0, "do": "revive", "robots": {"group": "flock"}},
]


def door(**more: Any) -> LiveEvents:
    scenario = scenario_from(changed("events", OF_SCENARIO), "s.toml")
    return LiveEvents(scenario, bodies_of(scenario, "s.toml"), **more)


def test_events_are_numbered_after_the_scenarios_and_happen_at_the_start_of_the_next_tick():
    kept: list[LiveEvent] = []
    given = door(record=kept.append)
    assert given.pop_due(3, RATE_HZ) == []
    assert (given.submit(KILL), given.submit(SET)) == (2, 3)
    taken = given.pop_due(4, RATE_HZ)
    assert [number for number, _ in taken] == [2, 3]
    assert isinstance(taken[0][1], Kill)
    assert taken[0][1].at_s == 0.4
    assert kept == [LiveEvent(4, 2, KILL), LiveEvent(4, 3, SET)]
    assert given.pop_due(5, RATE_HZ) == []


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ({}, "do: is missing; expected one of blackout"),
        ({"do": "burn"}, "do: expected one of blackout"),
        ({"do": "kill"}, "robots: is missing; expected a table"),
        ({"do": "kill", "robots": {"names": ["flock-99"]}}, "robots.names: expected names of robots, such as flock-0;"),
        ({"do": "kill", "robots": {"group": "flok"}}, "robots.group: expected one of flock (did you mean this?), big"),
        ({**KILL, "for_s": -1.0}, "for_s: expected a number above 0"),
        ({**KILL, "at_s": 3.0}, "at_s: expected no time"),
        ({**SET, "to": 2.0}, "to: expected at most 1"),
        ({"do": "jammer", "at": [0, 0], "power_dbm": 20.0}, "do: expected a radio with a PHY"),
        ({"do": "impulse", "robots": {"group": "flock"}, "speed_mps": 9.0}, "speed_mps: expected at most 1.75 m/s"),
        ({"do": "kill", "robots": {"share": float("nan")}}, "expected texts, finite numbers, lists and tables alone"),
        ({"do": "kill", "robots": {"group": b"flock"}}, "expected texts, finite numbers, lists and tables alone"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line_and_nothing_waits(table, line):
    given = door()
    with pytest.raises(BadInput, match="^[^\n]*$") as caught:
        given.submit(table)
    assert str(caught.value).startswith(line)
    assert given.pop_due(0, RATE_HZ) == []
    assert given.submit(KILL) == 2, "a number is not spent on it"


def test_an_event_is_ended_once_and_only_if_it_goes_on():
    given = door()
    number = given.submit(KILL)
    given.pop_due(0, RATE_HZ)
    given.progress.begin_tick[number] = 0
    given.end(number)
    assert given.pop_due(1, RATE_HZ) == [(number, None)]
    for wrong, line in (
        (number, "is over"),
        (9, "expected a number from 0 to 2, got 9"),
        (-1, "expected a number from 0 to 2"),
        (0, "expected an event that has begun; 0, a kill, has not"),
        (1, "expected an event that lasts; 1 is a revive, which happens once"),
    ):
        given.progress.ended.add(number)
        with pytest.raises(BadInput, match="^event: ") as caught:
            given.end(wrong)
        assert line in str(caught.value)


def test_an_event_that_is_ended_before_a_tick_never_happens():
    given = door()
    number = given.submit(KILL)
    given.end(number)
    assert given.pop_due(0, RATE_HZ) == []
    assert given.listing()[-1] == {
        "number": 2,
        "tick": None,
        "do": "kill",
        "text": 'kill robots = { names = ["flock-1"] }',
        "over": True,
        "given": True,
    }


def test_a_number_that_is_set_takes_the_place_of_what_it_was_set_to_before():
    given = door()
    first = given.submit(SET)
    given.pop_due(0, RATE_HZ)
    second = given.submit({**SET, "to": 0.6})
    other = given.submit({**SET, "what": "radio.range_m", "to": 1.0})
    slow = given.submit({**SET, "to": 0.7, "over_s": 3.0})
    assert [(number, event is None) for number, event in given.pop_due(1, RATE_HZ)] == [
        (first, True),
        (second, False),
        (other, False),
        (slow, False),
    ]


def test_what_contradicts_a_number_that_was_changed_is_refused():
    bursts = {"good_s": 1.0, "bad_s": 1.0, "loss_good": 0.1, "loss_bad": 0.9}
    scenario = scenario_from(changed("radio", {"range_m": 2.0, "bursts": bursts}), "s.toml")
    given = LiveEvents(scenario, bodies_of(scenario, "s.toml"))
    assert scenario.radio
    assert scenario.radio.bursts
    worse = given.submit({"do": "ramp", "what": "radio.bursts.loss_good", "to": 0.8})
    better = {"do": "ramp", "what": "radio.bursts.loss_bad", "to": 0.5}
    with pytest.raises(BadInput, match="^to: radio.bursts.loss_bad: expected at least loss_good, 0.8; got 0.5"):
        given.submit(better)
    given.end(worse)
    given.submit(better)


def test_what_cannot_be_recorded_does_not_happen():
    def full(_: LiveEvent) -> None:
        raise OSError("no room")

    given = door(record=full)
    number = given.submit(KILL)
    assert given.pop_due(0, RATE_HZ) == []
    assert given.listing()[-1]["over"]
    with pytest.raises(BadInput, match="is over"):
        given.end(number)


def test_an_event_whose_end_cannot_be_recorded_goes_on():
    def ends_do_not_fit(given: LiveEvent) -> None:
        if given.table is None:
            raise OSError("no room")

    given = door(record=ends_do_not_fit)
    number = given.submit({**KILL, "for_s": 9.0})
    given.pop_due(0, RATE_HZ)
    given.progress.begin_tick[number] = 0
    given.end(number)
    assert given.pop_due(1, RATE_HZ) == []
    assert not given.listing()[-1]["over"]
    given.end(number)  # may be asked for again


def test_a_run_that_is_paused_lets_only_so_many_wait():
    given = door()
    for _ in range(MAX_WAITING):
        given.submit(KILL)
    with pytest.raises(BadInput, match="resume the run"):
        given.submit(KILL)


def test_a_repetition_takes_what_was_done_and_nothing_new():
    done = [LiveEvent(3, 2, KILL), LiveEvent(3, 3, SET), LiveEvent(7, 2, None)]
    given = door(replayed=done)
    assert {tick: [number for number, _ in given.pop_due(tick, RATE_HZ)] for tick in (2, 3, 7)} == {
        2: [],
        3: [2, 3],
        7: [2],
    }
    for refused in (lambda: given.submit(KILL), lambda: given.end(2)):
        with pytest.raises(BadInput, match="the repetition"):
            refused()
    with pytest.raises(BadInput, match="^event 2 that was given: robots: is missing"):
        door(replayed=[LiveEvent(0, 2, {"do": "kill"})])
    with pytest.raises(BadInput, match="^event 1 that was given: expected a number that no other event has"):
        door(replayed=[LiveEvent(0, 1, KILL)])


def test_an_event_that_is_given_begins_and_ends_in_the_run_at_the_ticks_it_was_given_and_ended():
    scenario = posed([[-1.0, 0.0, 0.0], [-1.0, 1.0, 0.0]])
    given, watch = LiveEvents(scenario, bodies_of(scenario, "s.toml")), Watch()
    loop = Loop(World(scenario, [1], {}), None, Ahead(), [watch], live_events=given)
    loop.run(2)
    number = given.submit({"do": "kill", "robots": {"names": ["a-1"]}})
    loop.run(5)
    given.end(number)
    loop.run(8)
    assert [truth.alive.tolist() for truth in watch.seen] == [[True, True]] * 2 + [[True, False]] * 3 + [
        [True, True]
    ] * 3
    told = [(truth.tick, event.serial, event.ended) for truth in watch.seen for event in truth.events]
    assert told == [(2, number, False), (5, number, True)]
