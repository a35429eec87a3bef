"""Live events: their checks, numbers, ends and records."""

from typing import Any

import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.world.events.robot_events import Kill
from swarmwire.world.live_events import MAX_WAITING, LiveEvent, LiveEvents
from swarmwire.world.scenario.bodies import bodies_of
from swarmwire.world.scenario_file import scenario_from
from tests.support.refusals import refused_input
from tests.support.world.scenes import changed

RATE_HZ = 10
KILL: dict[str, Any] = {"do": "kill", "robots": {"names": ["flock-1"]}}
SET: dict[str, Any] = {"do": "ramp", "what": "radio.loss", "to": 0.5}
OF_SCENARIO = [
    {"at_s": 1.0, "do": "kill", "robots": {"group": "flock"}},
    {"at_s": 2.0, "do": "revive", "robots": {"group": "flock"}},
]


def live_events(**more: Any) -> LiveEvents:
    scenario = scenario_from(changed("events", OF_SCENARIO), "s.toml")
    return LiveEvents(scenario, bodies_of(scenario, "s.toml"), **more)


def test_live_events_are_numbered_and_happen_at_the_next_tick():
    recorded: list[LiveEvent] = []
    live = live_events(record=recorded.append)
    assert live.pop_due(3, RATE_HZ) == []
    assert (live.submit(KILL), live.submit(SET)) == (2, 3)
    due = live.pop_due(4, RATE_HZ)
    assert [number for number, _ in due] == [2, 3]
    assert isinstance(due[0][1], Kill)
    assert due[0][1].at_s == 0.4
    assert recorded == [LiveEvent(4, 2, KILL), LiveEvent(4, 3, SET)]
    assert live.pop_due(5, RATE_HZ) == []


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ({}, "do"),
        ({"do": "kill", "robots": {"names": ["flock-99"]}}, "robots.names"),
        ({**KILL, "at_s": 3.0}, "at_s"),
        ({**SET, "to": 2.0}, "to"),
        ({"do": "jammer", "at": [0, 0], "power_dbm": 20.0}, "do"),
        ({"do": "impulse", "robots": {"group": "flock"}, "speed_mps": 9.0}, "speed_mps"),
        ({"do": "kill", "robots": {"share": float("nan")}}, ""),
        ({"do": "kill", "robots": {"group": b"flock"}}, ""),
    ],
)
def test_faulty_live_event_is_refused_without_a_number(table, key):
    live = live_events()
    with refused_input(key=key):
        live.submit(table)
    assert live.pop_due(0, RATE_HZ) == []
    assert live.submit(KILL) == 2


def test_live_event_is_ended_once_and_only_while_it_lasts():
    live = live_events()
    number = live.submit(KILL)
    live.pop_due(0, RATE_HZ)
    live.progress.begin_tick[number] = 0
    live.end(number)
    assert live.pop_due(1, RATE_HZ) == [(number, None)]
    live.progress.ended.add(number)
    for wrong in (number, 9, -1, 0, 1):  # over; no such events; not begun; momentary
        with pytest.raises(BadInput, match="^event: "):
            live.end(wrong)


def test_live_event_that_is_ended_before_a_tick_never_happens():
    live = live_events()
    number = live.submit(KILL)
    live.end(number)
    assert live.pop_due(0, RATE_HZ) == []
    assert live.listing()[-1] == {
        "number": 2,
        "tick": None,
        "do": "kill",
        "text": 'kill robots = { names = ["flock-1"] }',
        "over": True,
        "given": True,
    }


def test_live_ramp_replaces_the_earlier_value_of_its_number():
    live = live_events()
    first = live.submit(SET)
    live.pop_due(0, RATE_HZ)
    second = live.submit({**SET, "to": 0.6})
    other = live.submit({**SET, "what": "radio.range_m", "to": 1.0})
    slow = live.submit({**SET, "to": 0.7, "over_s": 3.0})
    assert [(number, event is None) for number, event in live.pop_due(1, RATE_HZ)] == [
        (first, True),
        (second, False),
        (other, False),
        (slow, False),
    ]


def test_live_ramp_that_contradicts_an_earlier_one_is_refused():
    bursts = {"good_s": 1.0, "bad_s": 1.0, "loss_good": 0.1, "loss_bad": 0.9}
    scenario = scenario_from(changed("radio", {"range_m": 2.0, "bursts": bursts}), "s.toml")
    live = LiveEvents(scenario, bodies_of(scenario, "s.toml"))
    assert scenario.radio
    assert scenario.radio.bursts
    worse = live.submit({"do": "ramp", "what": "radio.bursts.loss_good", "to": 0.8})
    better = {"do": "ramp", "what": "radio.bursts.loss_bad", "to": 0.5}
    with pytest.raises(BadInput, match="^to: radio.bursts.loss_bad: expected at least loss_good, 0.8; got 0.5"):
        live.submit(better)
    live.end(worse)
    live.submit(better)


def test_live_event_that_cannot_be_recorded_does_not_happen():
    def full(_: LiveEvent) -> None:
        raise OSError("no room")

    live = live_events(record=full)
    number = live.submit(KILL)
    assert live.pop_due(0, RATE_HZ) == []
    assert live.listing()[-1]["over"]
    with pytest.raises(BadInput, match="is over"):
        live.end(number)


def test_live_event_continues_if_its_end_cannot_be_recorded():
    def ends_do_not_fit(live: LiveEvent) -> None:
        if live.table is None:
            raise OSError("no room")

    live = live_events(record=ends_do_not_fit)
    number = live.submit({**KILL, "for_s": 9.0})
    live.pop_due(0, RATE_HZ)
    live.progress.begin_tick[number] = 0
    live.end(number)
    assert live.pop_due(1, RATE_HZ) == []
    assert not live.listing()[-1]["over"]
    live.end(number)  # the end may be requested again


def test_live_events_waiting_in_a_paused_run_are_limited():
    live = live_events()
    for _ in range(MAX_WAITING):
        live.submit(KILL)
    with pytest.raises(BadInput, match="resume the run"):
        live.submit(KILL)


def test_replayed_live_events_happen_and_new_ones_are_refused():
    done = [LiveEvent(3, 2, KILL), LiveEvent(3, 3, SET), LiveEvent(7, 2, None)]
    live = live_events(replayed=done)
    assert {tick: [number for number, _ in live.pop_due(tick, RATE_HZ)] for tick in (2, 3, 7)} == {
        2: [],
        3: [2, 3],
        7: [2],
    }
    for call in (lambda: live.submit(KILL), lambda: live.end(2)):
        with pytest.raises(BadInput, match="the repetition"):
            call()
    with pytest.raises(BadInput, match="^live event 2: robots: is missing"):
        live_events(replayed=[LiveEvent(0, 2, {"do": "kill"})])
    with pytest.raises(BadInput, match="^live event 1: expected a number that no other event has"):
        live_events(replayed=[LiveEvent(0, 1, KILL)])
