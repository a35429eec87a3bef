"""An event that cannot be is refused at the door, in one line that names the file, the key and what was expected."""

from typing import Any

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.kill import Kill
from swarmwire.comms.events.partition import Partition
from swarmwire.comms.events.selection import Selection
from swarmwire.world.scenario.scenario_file import scenario_from
from tests.support.world.samples import SAMPLE, changed

FLOCK = {"group": "flock"}
NAMES = "expected names of robots, such as flock-0; got"
GROUPS = "expected groups (flock, big) or names of robots; got"


def event(do: str = "kill", at_s: Any = 1.0, **keys: Any) -> dict[str, Any]:
    return {"at_s": at_s, "do": do, **keys}


def kill(**robots: Any) -> dict[str, Any]:
    return event(robots=robots)


def partition(*between: list[str]) -> dict[str, Any]:
    return event("partition", between=list(between))


FAULTS: list[tuple[Any, str]] = [
    (
        3,
        "events.0: expected a table with do = one of blackout, fail, gain, jammer, kill, partition, push, ramp, revive",
    ),
    (
        {"at_s": 1.0},
        "events.0.do: is missing; expected one of blackout, fail, gain, jammer, kill, partition, push, ramp, revive",
    ),
    (
        event("burn"),
        "events.0.do: expected one of blackout, fail, gain, jammer, kill, partition, push, ramp, revive; got 'burn'",
    ),
    ({"do": "revive", "robots": FLOCK}, "events.0.at_s: is missing; expected a number of at least 0 and at most 10"),
    (event(at_s=-1.0, robots=FLOCK), "events.0.at_s: expected a number of at least 0 and at most 1000000000 (s), got"),
    (event(robots=FLOCK, for_s=-1.0), "events.0.for_s: expected a number above 0 and at most 1000000000 (s), got -1.0"),
    (event("revive", robots=FLOCK, for_s=1.0), "events.0.for_s: unknown key; expected one of at_s, do, robots"),
    (event(), "events.0.robots: is missing; expected a table"),
    (kill(), "events.0.robots: expected group, names, share or count"),
    (kill(group="flok"), "events.0.robots.group: expected one of flock, big (did you mean flock?); got 'flok'"),
    (kill(names=["flock-12"]), f"events.0.robots.names: {NAMES} 'flock-12'"),
    (kill(names=["flock-01"]), f"events.0.robots.names: {NAMES} 'flock-01'"),
    (kill(names=["flock"]), f"events.0.robots.names: {NAMES} 'flock'"),
    (kill(names=[]), "events.0.robots.names: expected a list that is not empty, got []"),
    (kill(names=["flock-1"], count=1), "events.0.robots: expected either names or some of group, share and count"),
    (kill(share=0.5, count=1), "events.0.robots: expected either share or count"),
    (kill(group="flock", share=0.0), "events.0.robots.share: expected a number above 0 and at most 1, got 0.0"),
    (kill(group="flock", share=1.1), "events.0.robots.share: expected a number above 0 and at most 1, got 1.1"),
    (kill(count=0), "events.0.robots.count: expected a whole number of at least 1, got 0"),
    (partition(["flock"]), "events.0.between: expected at least 2 sets of robots, got 1"),
    (partition(["flock"], []), "events.0.between.1: expected a list that is not empty, got []"),
    (partition(["flock"], ["small"]), f"events.0.between.1: {GROUPS} 'small'"),
    (
        partition(["flock"], ["flock-3", "big"]),
        "events.0.between.1: expected sets that do not overlap; 'flock-3'",
    ),
    (
        event("partition"),
        "events.0: expected one of between, region, halves, isolate, bridge, or halves and bridge; got",
    ),
    (event("partition", halves="x", isolate=["big"]), "events.0: expected one of between, region, halves, isolate,"),
    (event("partition", halves="z"), "events.0.halves: expected one of x, y, got 'z'"),
    (event("partition", isolate=[]), "events.0.isolate: expected a list that is not empty, got []"),
    (event("partition", bridge=["tall"]), f"events.0.bridge: {GROUPS} 'tall'"),
    (event("partition", region={}), "events.0.region: expected either radius_m or size_m"),
    (event("partition", region={"radius_m": 1.0, "size_m": [1.0, 1.0]}), "events.0.region: expected either radius_m"),
    (
        event("partition", region={"size_m": [1.0, 0.0]}),
        "events.0.region.size_m: expected two numbers above 0 (m), got",
    ),
    (event("partition", region={"radius_m": -1.0}), "events.0.region.radius_m: expected a number above 0 and at most"),
    (event("partition", isolate=["big"], one_way=True), "events.0.one_way: expected two sets with it"),
    (event("partition", between=[["flock-0"], ["flock-1"], ["big"]], one_way=True), "events.0.one_way: expected two"),
    (event("blackout", robots={"group": "x"}), "events.0.robots.group: expected one of flock, big; got 'x'"),
]


def ramp(what: str, to: float = 0.5, **keys: Any) -> dict[str, Any]:
    return event("ramp", what=what, to=to, **keys)


OF_RADIOS: list[tuple[Any, str]] = [
    (event("gain", robots=FLOCK), "events.0: expected send_db or receive_db"),
    (
        event("gain", robots=FLOCK, send_db=-3.0),
        "events.0.do: expected a radio with signals for 'gain': a disk knows no",
    ),
    (event("gain", robots=FLOCK, send_db=1e3), "events.0.send_db: expected a number of at least -200 and at most 100"),
    (event("jammer", at=[0.0, 0.0]), "events.0.power_dbm: is missing; expected a number of at least -100"),
    (event("jammer", power_dbm=0.0), "events.0: expected either at = [x, y] or robots"),
    (event("jammer", at=[0.0, 0.0], robots=FLOCK, power_dbm=0.0), "events.0: expected either at = [x, y] or robots"),
    (event("jammer", at=[0.0, 0.0], power_dbm=0.0, duty=0.0), "events.0.duty: expected a number above 0 and at most 1"),
    (
        event("jammer", at=[0.0, 0.0], power_dbm=0.0, period_s=1e-6),
        "events.0.period_s: expected at least 0.000010 s, got 1e-06",
    ),
    (event("jammer", at=[0.0], power_dbm=0.0), "events.0.at"),
    (
        event("jammer", at=[0.0, 0.0], power_dbm=0.0),
        "events.0.do: expected a radio with signals for 'jammer': a disk knows no strength",
    ),
    (event("ramp", to=0.5), "events.0.what: is missing; expected a text"),
    (ramp("loss"), "events.0.what: expected a key of [radio], such as radio.loss; got 'loss'"),
    (ramp("radio.lose"), "events.0.what: unknown key radio.lose; expected one of range_m, model, preset, "),
    (ramp("radio.loss.x"), "events.0.what: expected a key of [radio]; radio.loss holds no keys"),
    (ramp("radio.frame"), "events.0.what: expected a number; radio.frame is a text"),
    (ramp("radio.gives"), "events.0.what: expected a number; radio.gives is a table"),
    (
        ramp("radio.line_of_sight"),
        "events.0.what: expected a number that the scenario gives; radio.line_of_sight is left",
    ),
    (ramp("radio.bursts.bad_s"), "events.0.what: expected a table that the scenario gives; [radio.bursts] is left out"),
    (
        ramp("radio.send_offset"),
        "events.0.what: expected a number that may change; radio.send_offset holds for the whole",
    ),
    (ramp("radio.loss", 1.5), "events.0.to: expected at most 1, got 1.5 for radio.loss"),
    (ramp("radio.latency_s", -1.0), "events.0.to: expected at least 0 s, got -1.0 for radio.latency_s"),
    (ramp("radio.queue_limit", 2.5), "events.0.to: expected a whole number for radio.queue_limit, got 2.5"),
    (ramp("radio.loss", over_s=-1.0), "events.0.over_s: expected a number of at least 0 and at most"),
]


@pytest.mark.parametrize(("table", "text"), FAULTS + OF_RADIOS)
def test_a_fault_is_one_line_with_file_key_and_what_was_expected(table: Any, text: str):
    with pytest.raises(BadInput) as caught:
        scenario_from(changed("events", [table]), "f.toml")
    assert str(caught.value).startswith(f"f.toml: {text}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("table", [event("blackout", robots=FLOCK), partition(["flock"], ["big"]), ramp("radio.loss")])
def test_without_a_radio_there_is_nothing_to_disturb(table: Any):
    mute = {**{key: value for key, value in SAMPLE.items() if key != "radio"}, "events": [table]}
    with pytest.raises(BadInput, match=r"^f: events\.0\.do: expected a scenario with a \[radio\] for"):
        scenario_from(mute, "f")


def test_events_are_read_as_what_they_are_also_after_the_end():
    tables = [event(at_s=1e6, robots={**FLOCK, "share": 0.05}, for_s=20.0), partition(["flock-1", "big"], ["flock-0"])]
    assert scenario_from(changed("events", tables), "f").events == (
        Kill(at_s=1e6, for_s=20.0, robots=Selection(group="flock", share=0.05)),
        Partition(at_s=1.0, between=(("flock-1", "big"), ("flock-0",))),
    )
