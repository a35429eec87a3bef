"""A scenario is read whole, or refused with the file and the key; overrides change it by path."""

from pathlib import Path
from typing import Any

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.radio.config.impairments import BearingMeasure, Measures, RangeMeasure
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import load_scenario, scenario_from, scenario_schema
from tests.support.world.samples import SAMPLE, changed, without

POLYGON = {"shape": "polygon", "at": [0.0, 0.0]}
FLAT = [[0, 0], [1, 0], [2, 0]]
WIDE = {"shape": "polygon", "points": [[0, 0], [6.1, 0], [0, 1]]}
FAULTS: list[tuple[str, Any, str]] = [
    ("name", "", "name"),
    ("seed", -1, "seed"),
    ("duration_s", float("inf"), "duration_s"),
    ("time.rate_hz", 1001, "time.rate_hz"),
    ("physics.engine", "bullet", "physics.engine"),
    ("physics.steps", 1, "physics.steps"),
    ("arena.size_m", 3, "arena.size_m"),
    ("arena.size_m", [1.0], "arena.size_m.1"),
    ("arena.size_m", [1.0, float("nan")], "arena.size_m.1"),
    ("arena.boundary", "sea", "arena.boundary"),
    ("arena.windows", [], "arena.windows"),
    ("arena.lights", [{"at": [0, 0]}], "arena.lights.0.intensity"),
    ("arena.lights", [{"intensity": 1.0}], "arena.lights.0"),
    ("arena.lights", [{"intensity": 1, "at": [0, 0], "apart_m": 0.1}], "arena.lights.0"),
    ("arena.lights.0.within", {"how": "arena"}, "arena.lights.0.within.how"),
    ("arena.obstacles.1.within", {"how": "disc", "radius_m": 1.0}, "arena.obstacles.1"),
    ("arena.obstacles.1.height_m", 0, "arena.obstacles.1.height_m"),
    ("arena.map", {"image": "", "resolution_m": 1}, "arena.map.image"),
    ("arena.map", {"image": "maze.png", "resolution_m": -1}, "arena.map.resolution_m"),
    ("arena.ground.shade", 2, "arena.ground.shade"),
    (
        "arena.ground.patches",
        [{"shape": "polygon", "points": [[0, 0], [1, 0], [2, 0]], "shade": 0}],
        "arena.ground.patches.0.points",
    ),
    ("arena.ground.patches", [{"shape": "disc", "at": [0, 0], "shade": 0}], "arena.ground.patches.0.radius_m"),
    ("arena.lights", [{"intensity": 0, "at": [0, 0]}], "arena.lights.0.intensity"),
    ("arena.obstacles.0", {**POLYGON, "points": 3}, "arena.obstacles.0.points"),
    ("arena.obstacles.0", {**POLYGON, "points": [[0, 0], [1, 0]]}, "arena.obstacles.0.points"),
    ("arena.obstacles.0", {**POLYGON, "points": [[0, 0], [1, 0], [0.2, 0.2], [0, 1]]}, "arena.obstacles.0.points"),
    ("arena.obstacles.0", {**POLYGON, "points": FLAT}, "arena.obstacles.0.points"),
    ("arena.obstacles.0", {**POLYGON, "points": [[0, 0], [3, 0], [0, 1]], "at": [0.1, 0.0]}, "arena.obstacles.0"),
    (
        "arena.obstacles.0",
        {"shape": "polygon", "points": [[0, 0], [6.1, 0], [0, 1]], "place": "random"},
        "arena.obstacles.0",
    ),
    ("arena.obstacles.0.shape", "ring", "arena.obstacles.0.shape"),
    ("arena.obstacles.0.size_m", [1, 1], "arena.obstacles.0.size_m"),
    ("arena.obstacles.0.at", [1, 1], "arena.obstacles.0"),
    ("arena.obstacles.1.count", 4, "arena.obstacles.1"),
    ("arena.obstacles.1.at", [2.9, 0], "arena.obstacles.1"),
    ("arena.obstacles.0.radius_m", 3, "arena.obstacles.0"),
    ("robots", {}, "robots"),
    ("robots.9x", SAMPLE["robots"]["big"], "robots.9x"),
    ("robots.flock.count", "x", "robots.flock.count"),
    ("robots.flock.count", 0, "robots.flock.count"),
    ("robots.flock.count", True, "robots.flock.count"),
    ("robots.flock.body", "\0.toml", "robots.flock.body"),
    ("robots.flock.body", "car", "robots.flock.body"),
    ("robots.flock.colour", "red", "robots.flock.colour"),
    ("robots.flock.place", "random", "robots.flock.place"),
    ("robots.count", 3, "robots.count"),
    ("radio.preset", "wifi", "radio.preset"),
    ("physics.engine", "disc", "physics.engine"),
    ("robots.flock.place", {}, "robots.flock.place.how"),
    ("robots.flock.place.how", "heap", "robots.flock.place.how"),
    ("robots.flock.place", {"how": "ring", "inner_radius_m": 2.0, "radius_m": 1.0}, "robots.flock.place"),
    ("robots.flock.place.apart_m", -1, "robots.flock.place.apart_m"),
    ("robots.flock.place.heading_rad", "east", "robots.flock.place.heading_rad"),
    ("robots.flock.place.radius_m", "a", "robots.flock.place.radius_m"),
    ("robots.flock.place", {"how": "poses", "poses": [[0, 0, 0]]}, "robots.flock"),
    ("radio.loss", 2, "radio.loss"),
    ("radio.model", "x", "radio.model"),
    ("radio.measures.range.noise_m", -1, "radio.measures.range.noise_m"),
    ("radio.send_offset", "x", "radio.send_offset"),
    ("radio.send_offset", 0.1, "radio.send_offset"),
    ("run.on_runner_loss", "hope", "run.on_runner_loss"),
    ("run.watchdog_s", 0, "run.watchdog_s"),
    ("wind", [], "wind"),
]


@pytest.mark.parametrize(("path", "value", "key"), FAULTS)
def test_a_fault_is_refused_with_its_key(path: str, value: Any, key: str) -> None:
    with pytest.raises(BadInput) as caught:
        scenario_from(changed(path, value), "file.toml")
    assert (caught.value.where, caught.value.key) == ("file.toml", key)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("key", ["robots.flock.count", "arena.size_m"])
def test_a_missing_key_is_named(key: str) -> None:
    with pytest.raises(BadInput, match="is missing") as caught:
        scenario_from(without(key), "file.toml")
    assert caught.value.key == key


def test_the_keys_of_further_faults_are_named_up_to_six() -> None:
    mapping = {**changed("seed", -1), "name": "", "duration_s": 0}
    with pytest.raises(BadInput, match=r"\(also wrong: seed, duration_s\)$"):
        scenario_from(mapping, "f")
    with pytest.raises(BadInput, match=r"\(also wrong: b, c, d, e, f, g, …\)$"):
        scenario_from({**SAMPLE, **dict.fromkeys("abcdefgh", 1)}, "f")


def test_the_radio_comes_out_as_the_contract_s_dataclass() -> None:
    radio = scenario_from(SAMPLE, "f").radio
    assert radio == Radio(range_m=2.0, loss=0.3, measures=Measures(RangeMeasure(0.02), BearingMeasure(0.0)))
    assert scenario_from(without("radio"), "f").radio is None


def test_whole_numbers_stand_for_numbers_but_not_the_other_way_round() -> None:
    assert scenario_from(changed("duration_s", 5), "f").duration_s == 5.0
    with pytest.raises(BadInput, match="time.rate_hz: expected a whole number"):
        scenario_from(changed("time.rate_hz", 5.0), "f")


def test_robots_are_named_after_their_group() -> None:
    names = scenario_from(SAMPLE, "f").robot_names()
    assert (names[0], names[11], names[12], len(names)) == ("flock-0", "flock-11", "big-0", 15)


def test_the_schema_shows_bounds_units_and_help() -> None:
    schema = scenario_schema()
    reach = schema["$defs"]["Radio"]["properties"]["range_m"]
    assert (reach["anyOf"][0]["exclusiveMinimum"], reach["unit"]) == (0, "m")
    assert "receivers" in reach["description"]
    assert schema["properties"]["duration_s"]["unit"] == "s"


def written(folder: Path, text: str) -> Path:
    path = folder / "s.toml"
    path.write_text(text, encoding="utf-8")
    return path


MINIMAL = """
format = 1
name = "small"
duration_s = 1
arena = { size_m = [2, 2], obstacles = [{ shape = "cylinder", radius_m = 0.1, at = [0.5, 0.5] }] }
robots.flock = { body = "epuck", count = 2, agent = "a:B" }
"""


def test_a_file_is_read_and_overrides_are_toml_values_or_else_texts(tmp_path: Path) -> None:
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
def test_a_faulty_override_is_named(tmp_path: Path, override: str, key: str) -> None:
    path = written(tmp_path, MINIMAL + "radio = { range_m = 1 }\n")
    with pytest.raises(BadInput) as caught:
        load_scenario(path, [override])
    assert (caught.value.where, caught.value.key) == (f"--set {override}", key)
    assert "\n" not in str(caught.value)


def test_what_an_override_does_not_touch_is_the_file_s_fault(tmp_path: Path) -> None:
    path = written(tmp_path, MINIMAL.replace("count = 2", "count = 0"))
    with pytest.raises(BadInput) as caught:
        load_scenario(path, ["robots.flock.body=footbot"])
    assert (caught.value.where, caught.value.key) == (str(path), "robots.flock.count")


def test_a_mark_of_byte_order_before_the_text_does_no_harm(tmp_path: Path) -> None:
    assert load_scenario(written(tmp_path, "\ufeff" + MINIMAL)).name == "small"


@pytest.mark.parametrize("content", [None, b"seed = x", b"\xff\xfe"])
def test_an_unreadable_file_is_refused_by_its_name(tmp_path: Path, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / "s.toml").write_bytes(content)
    with pytest.raises(BadInput) as caught:
        load_scenario(tmp_path / "s.toml")
    assert caught.value.where == str(tmp_path / "s.toml")


def test_a_scenario_cannot_be_changed() -> None:
    scenario = scenario_from(SAMPLE, "f")
    with pytest.raises(ValueError, match="frozen"):
        scenario.seed = 4  # pyright: ignore[reportAttributeAccessIssue] - frozen: that is what is tested
    assert isinstance(scenario, Scenario)
