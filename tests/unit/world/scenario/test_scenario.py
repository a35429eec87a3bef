"""Scenarios: read, checked, and written."""

import tomllib
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.config.impairments import BearingMeasure, Measures, RangeMeasure
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.world.events.partition import Partition
from swarmwire.world.events.robot_events import Kill
from swarmwire.world.events.selection import Selection
from swarmwire.world.scenario.scenario import Scenario, mapping_of, same_content
from swarmwire.world.scenario.schema import Node, plain, words
from swarmwire.world.scenario.tables import MetricTable
from swarmwire.world.scenario_file import load_scenario, scenario_from, scenario_schema
from tests.support.deploy.runs import LOSSY, ROOT
from tests.support.refusals import refused_input
from tests.support.world.scenes import SAMPLE, changed, without

POLYGON = {"shape": "polygon", "at": [0.0, 0.0]}
FLAT = [[0, 0], [1, 0], [2, 0]]
WIDE = {"shape": "polygon", "points": [[0, 0], [6.1, 0], [0, 1]]}
BAD_VALUES: dict[str, list[Any]] = {  # of a key, which the line names
    "name": [""],
    "seed": [-1],
    "format": [2],
    "duration_s": [float("inf"), 0],
    "time.rate_hz": [1001],
    "physics.engine": ["bullet", "disc"],
    "physics.steps": [1],
    "arena.size_m": [3],
    "arena.boundary": ["sea"],
    "arena.windows": [[]],
    "arena.obstacles.1.height_m": [0],
    "arena.ground.shade": [2],
    "arena.obstacles.0": [
        {**POLYGON, "points": [[0, 0], [3, 0], [0, 1]], "at": [0.1, 0.0]},
        {**WIDE, "place": "random"},
    ],
    "arena.obstacles.0.shape": ["ring"],
    "arena.obstacles.0.size_m": [[1, 1]],
    "robots": [{}],
    "robots.9x": [SAMPLE["robots"]["big"]],
    "robots.flock.count": ["x", 0, True],
    "robots.flock.act_every_ticks": [0, 1.5],
    "robots.flock.body": ["\0.toml", "car"],
    "robots.flock.colour": ["red"],
    "robots.flock.place": ["random", {"how": "ring", "inner_radius_m": 2.0, "radius_m": 1.0}],
    "robots.count": [3],
    "radio.preset": ["wifi"],
    "robots.flock.place.how": ["heap"],
    "robots.flock.place.apart_m": [-1],
    "robots.flock.place.heading_rad": ["east"],
    "robots.flock.place.radius_m": ["a"],
    "radio.loss": [2],
    "radio.range_m": [-1],
    "radio.bit_rate_bps": [10**21],
    "radio.queue_limit": [10**21],
    "radio.model": ["x"],
    "radio.measures.range.noise_m": [-1],
    "radio.send_offset": ["x", 0.1, -0.1],
    "run.on_runner_loss": ["hope"],
    "run.watchdog_s": [0],
    "wind": [[]],
}
FAULTS: list[tuple[str, Any, str]] = [
    *((key, value, key) for key, values in BAD_VALUES.items() for value in values),
    ("arena.size_m", [1.0], "arena.size_m.1"),
    ("arena.size_m", [1.0, float("nan")], "arena.size_m.1"),
    ("arena.lights", [{"at": [0, 0]}], "arena.lights.0.intensity"),
    ("arena.lights", [{"intensity": 1.0}], "arena.lights.0"),
    ("arena.lights", [{"intensity": 1, "at": [0, 0], "apart_m": 0.1}], "arena.lights.0"),
    ("arena.lights.0.within", {"how": "arena"}, "arena.lights.0.within.how"),
    ("arena.obstacles.1.within", {"how": "disc", "radius_m": 1.0}, "arena.obstacles.1"),
    ("arena.map", {"image": "", "resolution_m": 1}, "arena.map.image"),
    ("arena.map", {"image": "maze.png", "resolution_m": -1}, "arena.map.resolution_m"),
    ("arena.ground.patches", [{"shape": "polygon", "points": FLAT, "shade": 0}], "arena.ground.patches.0.points"),
    ("arena.ground.patches", [{"shape": "disc", "at": [0, 0], "shade": 0}], "arena.ground.patches.0.radius_m"),
    ("arena.lights", [{"intensity": 0, "at": [0, 0]}], "arena.lights.0.intensity"),
    ("arena.lights", [{"intensity": 1, "at": [0, 0], "place": "random"}], "arena.lights.0"),
    ("arena.obstacles.0", {**POLYGON, "points": 3}, "arena.obstacles.0.points"),
    ("arena.obstacles.0", {**POLYGON, "points": [[0, 0], [1, 0]]}, "arena.obstacles.0.points"),
    ("arena.obstacles.0", {**POLYGON, "points": [[0, 0], [1, 0], [0.2, 0.2], [0, 1]]}, "arena.obstacles.0.points"),
    ("arena.obstacles.0", {**POLYGON, "points": FLAT}, "arena.obstacles.0.points"),
    ("arena.obstacles.0", {**POLYGON, "points": [[0, 0], [1, 1], [1, 0], [0, 1]]}, "arena.obstacles.0.points"),
    ("arena.obstacles.0", {**POLYGON, "points": [[0, 0], [1, 0], ["x", 1]]}, "arena.obstacles.0.points.2.0"),
    ("arena.obstacles.0.at", [1, 1], "arena.obstacles.0"),
    ("arena.obstacles.1.count", 4, "arena.obstacles.1"),
    ("arena.obstacles.1.at", [2.9, 0], "arena.obstacles.1"),
    ("arena.obstacles.0.radius_m", 3, "arena.obstacles.0"),
    ("robots.flock.place", {}, "robots.flock.place.how"),
    ("robots.flock.place", {"how": "poses", "poses": [[0, 0, 0]]}, "robots.flock"),
]
MINIMAL = """
format = 1
name = "small"
duration_s = 1
arena = { size_m = [2, 2], obstacles = [{ shape = "cylinder", radius_m = 0.1, at = [0.5, 0.5] }] }
robots.flock = { body = "epuck", count = 2, agent = "a:B" }
"""
SCENARIOS = sorted((ROOT / "scenarios").glob("*.toml"))
SCHEMA: Node = {"$defs": {"Disc": {"type": "object", "properties": {"radius_m": {"type": "number"}}}}}
FLOCK = {"group": "flock"}
METRIC_FAULTS: list[tuple[str, Any, str]] = [
    ("standard_metrics", 1, "standard_metrics"),
    ("metrics", "order", "metrics"),
    ("metrics", ["order", 5], "metrics.1"),
    ("metrics", [""], "metrics.0"),
    ("metrics", [{"gap_m": 1}], "metrics.0.metric"),
    ("stop", 3, "stop"),
    ("stop", [3], "stop.0"),
    ("stop", {"above": 1}, "stop.metric"),
    ("stop", {"metric": "order"}, "stop"),
    ("stop", [{"metric": "order", "above": 1, "below": 2}], "stop.0"),
    ("stop", {"metric": "order", "above": "x"}, "stop.above"),
    ("stop", {"metric": "order", "abov": 1}, "stop.abov"),
    ("stop", [{"metric": "order", "above": 1, "hold_s": -1}], "stop.0.hold_s"),
]


def event(do: str = "kill", at_s: Any = 1.0, **keys: Any) -> dict[str, Any]:
    return {"at_s": at_s, "do": do, **keys}


def kill(**robots: Any) -> dict[str, Any]:
    return event(robots=robots)


def partition(*between: list[str]) -> dict[str, Any]:
    return event("partition", between=list(between))


def ramp(key: str, to: float = 0.5, **keys: Any) -> dict[str, Any]:
    return event("ramp", what=key, to=to, **keys)


JAM = {"at": [0.0, 0.0], "power_dbm": 0.0}
NO_NUMBERS = ("radio.frame", "radio.measures", "radio.line_of_sight", "radio.bursts.bad_s", "radio.send_offset")
EVENT_FAULTS: dict[str, list[Any]] = {  # by the key below events.0
    ".do": [{"at_s": 1.0}, event("burn"), event("gain", robots=FLOCK, send_db=-3.0), event("jammer", **JAM)],
    ".at_s": [{"do": "revive", "robots": FLOCK}, *(event(at_s=at_s, robots=FLOCK) for at_s in (-1.0, float("nan")))],
    ".for_s": [*(event(robots=FLOCK, for_s=for_s) for for_s in (-1.0, 0.0)), event("revive", robots=FLOCK, for_s=1.0)],
    ".robots": [event(), event(robots=3), kill(), kill(names=["flock-1"], count=1), kill(share=0.5, count=1)],
    ".robots.grup": [kill(grup="flock")],
    ".robots.group": [kill(group="flok"), event("blackout", robots={"group": "x"})],
    ".robots.names": [kill(names=names) for names in (["flock-12"], ["flock-01"], ["flock"], [])],
    ".robots.share": [kill(group="flock", share=share) for share in (0.0, 1.1)],
    ".robots.count": [kill(count=0)],
    ".part": [event("fail", robots=FLOCK), event("fail", robots=FLOCK, part="nose")],
    ".per_hour": [event("fail", robots=FLOCK, part="motors", per_hour=0.0)],
    "": [
        *(3, event("partition"), event("partition", halves="x", isolate=["big"]), event("gain", robots=FLOCK)),
        *(event("jammer", power_dbm=0.0), event("jammer", robots=FLOCK, **JAM)),
    ],
    ".between": [partition(["flock"])],
    ".between.0": [event("partition", between=["flock-0", "flock-1"])],
    ".between.1": [partition(["flock"], other) for other in ([], ["small"], ["flock-3", "big"])],
    ".halves": [event("partition", halves="z")],
    ".isolate": [event("partition", isolate=[])],
    ".bridge": [event("partition", bridge=["tall"])],
    ".region": [event("partition", region=region) for region in ({}, {"radius_m": 1.0, "size_m": [1.0, 1.0]})],
    ".region.size_m": [event("partition", region={"size_m": [1.0, 0.0]})],
    ".region.radius_m": [event("partition", region={"radius_m": -1.0})],
    ".one_way": [
        event("partition", isolate=["big"], one_way=True),
        event("partition", between=[["flock-0"], ["flock-1"], ["big"]], one_way=True),
    ],
    ".send_db": [event("gain", robots=FLOCK, send_db=1e3)],
    ".power_dbm": [event("jammer", at=[0.0, 0.0])],
    ".duty": [event("jammer", **JAM, duty=0.0)],
    ".period_s": [event("jammer", **JAM, period_s=1e-6)],
    ".at.1": [event("jammer", **{**JAM, "at": [0.0]})],
    ".what": [event("ramp", to=0.5), *map(ramp, ("loss", "radio.lose", "radio.loss.x", *NO_NUMBERS))],
    ".to": [ramp("radio.loss", 1.5), ramp("radio.latency_s", -1.0), ramp("radio.queue_limit", 2.5)],
    ".over_s": [ramp("radio.loss", over_s=-1.0)],
}


@pytest.mark.parametrize(
    ("path", "value", "key"),
    [
        *(FAULTS + METRIC_FAULTS),
        *(("events", [table], f"events.0{key}") for key, tables in EVENT_FAULTS.items() for table in tables),
    ],
)
def test_scenario_fault_is_refused_with_its_key(path: str, value: Any, key: str) -> None:
    with refused_input("file.toml", key):
        scenario_from(changed(path, value), "file.toml")


@pytest.mark.parametrize("key", ["robots.flock.count", "arena.size_m"])
def test_missing_key_is_named(key: str) -> None:
    with refused_input(key=key, match="is missing"):
        scenario_from(without(key), "file.toml")


def test_further_faults_are_named_up_to_six_keys() -> None:
    mapping = {**changed("seed", -1), "name": "", "duration_s": 0}
    with pytest.raises(BadInput, match=r"\(also wrong: seed, duration_s\)$"):
        scenario_from(mapping, "f")
    with pytest.raises(BadInput, match=r"\(also wrong: b, c, d, e, f, g, …\)$"):
        scenario_from({**SAMPLE, **dict.fromkeys("abcdefgh", 1)}, "f")


def test_radio_table_becomes_the_radio_dataclass() -> None:
    radio = scenario_from(SAMPLE, "f").radio
    assert radio == Radio(range_m=2.0, loss=0.3, measures=Measures(RangeMeasure(0.02), BearingMeasure(0.0)))
    assert scenario_from(without("radio"), "f").radio is None


def test_integers_are_accepted_as_floats_but_floats_not_as_integers() -> None:
    assert scenario_from(changed("duration_s", 5), "f").duration_s == 5.0
    with refused_input(key="time.rate_hz"):
        scenario_from(changed("time.rate_hz", 5.0), "f")


def test_robots_are_named_after_their_group() -> None:
    names = scenario_from(SAMPLE, "f").robot_names()
    assert (names[0], names[11], names[12], len(names)) == ("flock-0", "flock-11", "big-0", 15)


def test_schema_has_bounds_units_and_help() -> None:
    schema = scenario_schema()
    reach = schema["$defs"]["Radio"]["properties"]["range_m"]
    assert (reach["anyOf"][0]["exclusiveMinimum"], reach["unit"]) == (0, "m")
    assert "receivers" in reach["description"]
    assert schema["properties"]["duration_s"]["unit"] == "s"


def written(folder: Path, text: str) -> Path:
    path = folder / "s.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_overrides_are_toml_values_or_else_texts(tmp_path: Path) -> None:
    path = written(tmp_path, MINIMAL)
    overrides = [
        "robots.flock.count=3",
        "robots.flock.params.separation_m=0.3",
        "robots.flock.agent=my.py:Mine",
        "arena.obstacles.0.radius_m=0.2",
        "arena.size_m=[3.0, 3.0]",
    ]
    scenario = load_scenario(path, overrides)
    flock = scenario.robots["flock"]
    assert (flock.count, flock.params, flock.agent) == (3, {"separation_m": 0.3}, "my.py:Mine")
    assert (scenario.arena.obstacles[0].model_dump()["radius_m"], scenario.arena.size_m) == (0.2, (3.0, 3.0))
    assert scenario.source == str(path)


@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("robots.flok.count=3", "robots.flok.body"),
        ("radio={}", "radio.range_m"),
        ("robots.flock.count=many", "robots.flock.count"),
        ("radio.foo=1", "radio.foo"),
        ("seed", ""),
        ("name.x=1", "name.x"),
        ("arena.obstacles.3.radius_m=1", "arena.obstacles.3"),
    ],
)
def test_faulty_override_is_refused_with_its_option(tmp_path: Path, override: str, key: str) -> None:
    path = written(tmp_path, MINIMAL + "radio = { range_m = 1 }\n")
    with refused_input(f"--set {override}", key):
        load_scenario(path, [override])


def test_fault_of_the_file_is_not_blamed_on_an_override(tmp_path: Path) -> None:
    path = written(tmp_path, MINIMAL.replace("count = 2", "count = 0"))
    with refused_input(path, "robots.flock.count"):
        load_scenario(path, ["robots.flock.body=footbot"])


def test_byte_order_mark_is_ignored(tmp_path: Path) -> None:
    assert load_scenario(written(tmp_path, "\ufeff" + MINIMAL)).name == "small"


@pytest.mark.parametrize("content", [None, b"seed = x", b"\xff\xfe"])
def test_unreadable_scenario_is_refused_with_its_file(tmp_path: Path, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / "s.toml").write_bytes(content)
    with refused_input(tmp_path / "s.toml"):
        load_scenario(tmp_path / "s.toml")


def test_scenario_is_frozen() -> None:
    scenario = scenario_from(SAMPLE, "f")
    with pytest.raises(ValueError, match="frozen"):
        scenario.seed = 4  # pyright: ignore[reportAttributeAccessIssue] - frozen
    assert isinstance(scenario, Scenario)


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_mapping_of_a_scenario_equals_its_file_and_loads_equal_after_a_change(path):
    scenario = load_scenario(path)
    assert mapping_of(scenario) == tomllib.loads(path.read_text())
    changed = scenario.model_copy(update={"duration_s": 1.5})
    mapping = mapping_of(changed)
    assert mapping["duration_s"] == 1.5
    assert same_content(scenario_from(mapping, str(path)), changed)  # near the pictures that it names


def test_mapping_of_a_scenario_is_a_copy_with_the_overrides():
    scenario = load_scenario(LOSSY, ["radio.loss=0.25", "run.on_runner_loss=dead"])
    mapping = mapping_of(scenario)
    assert mapping["radio"]["loss"] == 0.25
    assert mapping["run"] == {"on_runner_loss": "dead"}
    before = deepcopy(mapping)
    mapping["robots"]["flock"]["count"] = 1
    assert mapping_of(scenario) == before


@pytest.mark.parametrize(
    ("node", "expected"),
    [
        ({"type": "integer", "minimum": 1, "maximum": 1000}, "a whole number of at least 1 and at most 1000"),
        ({"type": "number", "exclusiveMinimum": 0, "unit": "s"}, "a number above 0 (s)"),
        ({"enum": ["walls", "open"]}, "one of walls, open"),
        ({"type": "string", "minLength": 1}, "a text that is not empty"),
        ({"anyOf": [{"type": "boolean"}, {"type": "string"}]}, "true or false or a text"),
        ({"type": "array", "prefixItems": [{"type": "number"}, {"type": "number"}]}, "a list of 2 numbers"),
        ({"$ref": "#/$defs/Disc"}, "a table"),
    ],
)
def test_schema_node_is_described_in_words(node, expected):
    assert words(node, SCHEMA) == expected


def test_schema_reference_that_may_be_null_resolves_to_its_table():
    node = {"anyOf": [{"$ref": "#/$defs/Disc"}, {"type": "null"}], "default": None}
    assert plain(node, SCHEMA) == SCHEMA["$defs"]["Disc"]


@pytest.mark.parametrize("table", [event("blackout", robots=FLOCK), partition(["flock"], ["big"]), ramp("radio.loss")])
def test_radio_events_without_a_radio_are_refused(table: Any):
    mute = {**{key: value for key, value in SAMPLE.items() if key != "radio"}, "events": [table]}
    with refused_input(key="events.0.do"):
        scenario_from(mute, "f")


def test_events_become_their_classes_also_after_the_end():
    tables = [event(at_s=1e6, robots={**FLOCK, "share": 0.05}, for_s=20.0), partition(["flock-1", "big"], ["flock-0"])]
    assert scenario_from(changed("events", tables), "f").events == (
        Kill(at_s=1e6, for_s=20.0, robots=Selection(group="flock", share=0.05)),
        Partition(at_s=1.0, between=(("flock-1", "big"), ("flock-0",))),
    )


def test_stop_is_a_table_or_a_list_of_tables() -> None:
    order = {"metric": "order", "at_least": 1, "hold_s": 2}
    [(path, table)] = scenario_from(changed("stop", order), "file.toml").stops().items()
    assert (path, table.metric, table.comparison, table.hold_s) == ("stop", "order", ("at_least", 1.0), 2.0)
    assert list(scenario_from(changed("stop", [order, order]), "file.toml").stops()) == ["stop.0", "stop.1"]
    assert scenario_from(changed("stop", []), "file.toml").stops() == {}
    assert scenario_from(changed("stop", order), "file.toml", ["stop=[]"]).stops() == {}


def test_metric_parameters_are_read_and_can_be_overridden() -> None:
    mapping = changed("metrics", ["order", {"metric": "fragmentations", "hold_s": 2.0}])
    scenario = scenario_from(mapping, "file.toml", ["metrics.1.hold_s=3.0"])
    assert scenario.metrics == ("order", MetricTable(metric="fragmentations", hold_s=3.0))
    assert [item.params for item in scenario.metrics if isinstance(item, MetricTable)] == [{"hold_s": 3.0}]
    again = mapping_of(scenario.model_copy(update={"duration_s": 2.0}))
    assert again["metrics"] == ["order", {"metric": "fragmentations", "hold_s": 3.0}]
