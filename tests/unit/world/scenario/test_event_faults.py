"""An event that cannot be is refused when the scenario is read, with the file and the key."""

from typing import Any

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.partition import Partition
from swarmwire.comms.events.robot_events import Kill
from swarmwire.comms.events.selection import Selection
from swarmwire.world.scenario_file import scenario_from
from tests.support.world.samples import SAMPLE, changed

FLOCK = {"group": "flock"}


def event(do: str = "kill", at_s: Any = 1.0, **keys: Any) -> dict[str, Any]:
    return {"at_s": at_s, "do": do, **keys}


def kill(**robots: Any) -> dict[str, Any]:
    return event(robots=robots)


def partition(*between: list[str]) -> dict[str, Any]:
    return event("partition", between=list(between))


FAULTS: list[tuple[Any, str]] = [
    (3, "events.0"),
    ({"at_s": 1.0}, "events.0.do"),
    (event("burn"), "events.0.do"),
    ({"do": "revive", "robots": FLOCK}, "events.0.at_s"),
    (event(at_s=-1.0, robots=FLOCK), "events.0.at_s"),
    (event(robots=FLOCK, for_s=-1.0), "events.0.for_s"),
    (event("revive", robots=FLOCK, for_s=1.0), "events.0.for_s"),
    (event(), "events.0.robots"),
    (kill(), "events.0.robots"),
    (kill(group="flok"), "events.0.robots.group"),
    (kill(names=["flock-12"]), "events.0.robots.names"),
    (kill(names=["flock-01"]), "events.0.robots.names"),
    (kill(names=["flock"]), "events.0.robots.names"),
    (kill(names=[]), "events.0.robots.names"),
    (kill(names=["flock-1"], count=1), "events.0.robots"),
    (kill(share=0.5, count=1), "events.0.robots"),
    (kill(group="flock", share=0.0), "events.0.robots.share"),
    (kill(group="flock", share=1.1), "events.0.robots.share"),
    (kill(count=0), "events.0.robots.count"),
    (partition(["flock"]), "events.0.between"),
    (partition(["flock"], []), "events.0.between.1"),
    (partition(["flock"], ["small"]), "events.0.between.1"),
    (partition(["flock"], ["flock-3", "big"]), "events.0.between.1"),
    (event("partition"), "events.0"),
    (event("partition", halves="x", isolate=["big"]), "events.0"),
    (event("partition", halves="z"), "events.0.halves"),
    (event("partition", isolate=[]), "events.0.isolate"),
    (event("partition", bridge=["tall"]), "events.0.bridge"),
    (event("partition", region={}), "events.0.region"),
    (event("partition", region={"radius_m": 1.0, "size_m": [1.0, 1.0]}), "events.0.region"),
    (event("partition", region={"size_m": [1.0, 0.0]}), "events.0.region.size_m"),
    (event("partition", region={"radius_m": -1.0}), "events.0.region.radius_m"),
    (event("partition", isolate=["big"], one_way=True), "events.0.one_way"),
    (event("partition", between=[["flock-0"], ["flock-1"], ["big"]], one_way=True), "events.0.one_way"),
    (event("blackout", robots={"group": "x"}), "events.0.robots.group"),
]


def ramp(what: str, to: float = 0.5, **keys: Any) -> dict[str, Any]:
    return event("ramp", what=what, to=to, **keys)


OF_RADIOS: list[tuple[Any, str]] = [
    (event("gain", robots=FLOCK), "events.0"),
    (event("gain", robots=FLOCK, send_db=-3.0), "events.0.do"),
    (event("gain", robots=FLOCK, send_db=1e3), "events.0.send_db"),
    (event("jammer", at=[0.0, 0.0]), "events.0.power_dbm"),
    (event("jammer", power_dbm=0.0), "events.0"),
    (event("jammer", at=[0.0, 0.0], robots=FLOCK, power_dbm=0.0), "events.0"),
    (event("jammer", at=[0.0, 0.0], power_dbm=0.0, duty=0.0), "events.0.duty"),
    (event("jammer", at=[0.0, 0.0], power_dbm=0.0, period_s=1e-6), "events.0.period_s"),
    (event("jammer", at=[0.0], power_dbm=0.0), "events.0.at.1"),
    (event("jammer", at=[0.0, 0.0], power_dbm=0.0), "events.0.do"),
    (event("ramp", to=0.5), "events.0.what"),
    (ramp("loss"), "events.0.what"),
    (ramp("radio.lose"), "events.0.what"),
    (ramp("radio.loss.x"), "events.0.what"),
    (ramp("radio.frame"), "events.0.what"),
    (ramp("radio.measures"), "events.0.what"),
    (ramp("radio.line_of_sight"), "events.0.what"),
    (ramp("radio.bursts.bad_s"), "events.0.what"),
    (ramp("radio.send_offset"), "events.0.what"),
    (ramp("radio.loss", 1.5), "events.0.to"),
    (ramp("radio.latency_s", -1.0), "events.0.to"),
    (ramp("radio.queue_limit", 2.5), "events.0.to"),
    (ramp("radio.loss", over_s=-1.0), "events.0.over_s"),
]


@pytest.mark.parametrize(("table", "key"), FAULTS + OF_RADIOS)
def test_a_fault_is_refused_with_its_key(table: Any, key: str):
    with pytest.raises(BadInput) as caught:
        scenario_from(changed("events", [table]), "f.toml")
    assert (caught.value.where, caught.value.key) == ("f.toml", key)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("table", [event("blackout", robots=FLOCK), partition(["flock"], ["big"]), ramp("radio.loss")])
def test_without_a_radio_there_is_nothing_to_disturb(table: Any):
    mute = {**{key: value for key, value in SAMPLE.items() if key != "radio"}, "events": [table]}
    with pytest.raises(BadInput) as caught:
        scenario_from(mute, "f")
    assert caught.value.key == "events.0.do"


def test_events_are_read_as_what_they_are_also_after_the_end():
    tables = [event(at_s=1e6, robots={**FLOCK, "share": 0.05}, for_s=20.0), partition(["flock-1", "big"], ["flock-0"])]
    assert scenario_from(changed("events", tables), "f").events == (
        Kill(at_s=1e6, for_s=20.0, robots=Selection(group="flock", share=0.05)),
        Partition(at_s=1.0, between=(("flock-1", "big"), ("flock-0",))),
    )
