"""A scenario is refused at the door, in one line that names the file, the key and what was expected."""

from pathlib import Path
from typing import Any

import pytest

from swarmwire.comms.air.parameters.gives import BearingGiven, Gives, RangeGiven
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.bodies.body import body_names
from swarmwire.comms.errors import BadInput
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario.scenario_file import load_scenario, scenario_from, scenario_schema
from tests.support.world.samples import SAMPLE, changed, without

COUNT = "expected a whole number of at least 1 and at most 1000000"
OFFSET = "expected uniform, tick, or an offset in s from 0 to below the period of a tick"
NUMBER = "expected a number above 0 and at most 10000 (m)"
STEPS = "so that a robot of flock at full speed moves at most a quarter of its radius in one step"
GAP = "expected a number of at least 0 and at most 10000 (m)"
HEADING = "expected a number of at least -7 and at most 7 (rad)"
RANDOM_ALONE = 'expected place = "random" with within or apart_m, not at = [x, y]'
CONVEX = "expected the corners of a convex polygon in order"
POLYGON = {"shape": "polygon", "at": [0.0, 0.0]}
FAULTS: list[tuple[str, Any, str]] = [
    ("name", "", "name: expected a text that is not empty, got ''"),
    ("seed", -1, "seed: expected a whole number of at least 0 and at most 9223372036854775807, got -1"),
    ("duration_s", float("inf"), "duration_s: expected a number above 0 and at most 1000000000 (s), got inf"),
    ("time.rate_hz", 1001, "time.rate_hz: expected a whole number of at least 1 and at most 1000 (Hz), got 1001"),
    ("physics.engine", "bullet", "physics.engine: expected one of auto, discs, pymunk, kinematic, got 'bullet'"),
    ("physics.steps", 1, f"physics.steps: expected at least 2, {STEPS}; got 1"),
    ("arena.size_m", 3, "arena.size_m: expected a list of 2 numbers above 0 and at most 10000 (m), got 3"),
    ("arena.size_m", [1.0], f"arena.size_m.1: is missing; {NUMBER}"),
    ("arena.size_m", [1.0, float("nan")], f"arena.size_m.1: {NUMBER}, got nan"),
    ("arena.boundary", "sea", "arena.boundary: expected one of walls, open, torus, got 'sea'"),
    (
        "arena.windows",
        [],
        "arena.windows: unknown key; expected one of size_m, boundary, obstacles, lights, map, ground",
    ),
    ("arena.lights", [{"at": [0, 0]}], f"arena.lights.0.intensity: is missing; {NUMBER}"),
    ("arena.lights", [{"intensity": 1.0}], 'arena.lights.0: expected either at = [x, y] or place = "random"'),
    ("arena.lights", [{"intensity": 1, "at": [0, 0], "apart_m": 0.1}], f"arena.lights.0: {RANDOM_ALONE}"),
    (
        "arena.lights.0.within",
        {"how": "arena"},
        "arena.lights.0.within.how: expected one of box, disc, ring; got 'arena'",
    ),
    ("arena.obstacles.1.within", {"how": "disc", "radius_m": 1.0}, f"arena.obstacles.1: {RANDOM_ALONE}"),
    ("arena.obstacles.1.height_m", 0, f"arena.obstacles.1.height_m: {NUMBER}, got 0"),
    ("arena.map", {"image": "", "resolution_m": 1}, "arena.map.image: expected a text that is not empty, got ''"),
    ("arena.map", {"image": "maze.png", "resolution_m": -1}, f"arena.map.resolution_m: {NUMBER}, got -1"),
    ("arena.ground.shade", 2, "arena.ground.shade: expected a number of at least 0 and at most 1, got 2"),
    (
        "arena.ground.patches",
        [{"shape": "polygon", "points": [[0, 0], [1, 0], [2, 0]], "shade": 0}],
        f"arena.ground.patches.0.points: {CONVEX}; (0, 0) lies on or beyond the side from (2, 0) to (1, 0)",
    ),
    (
        "arena.ground.patches",
        [{"shape": "disc", "at": [0, 0], "shade": 0}],
        f"arena.ground.patches.0.radius_m: is missing; {NUMBER}",
    ),
    ("arena.lights", [{"intensity": 0, "at": [0, 0]}], f"arena.lights.0.intensity: {NUMBER}, got 0"),
    ("arena.obstacles.0", {**POLYGON, "points": 3}, "arena.obstacles.0.points: expected a list (m), got 3"),
    (
        "arena.obstacles.0",
        {**POLYGON, "points": [[0, 0], [1, 0]]},
        "arena.obstacles.0.points: expected 3 to 100 points, got 2",
    ),
    (
        "arena.obstacles.0",
        {**POLYGON, "points": [[0, 0], [1, 0], [0.2, 0.2], [0, 1]]},
        f"arena.obstacles.0.points: {CONVEX}; (0, 1) lies on or beyond the side from (1, 0) to (0.2, 0.2)",
    ),
    (
        "arena.obstacles.0",
        {**POLYGON, "points": [[0, 0], [1, 0], [2, 0]]},
        f"arena.obstacles.0.points: {CONVEX}; (0, 0) lies on or beyond the side from (2, 0) to (1, 0)",
    ),
    (
        "arena.obstacles.0",
        {**POLYGON, "points": [[0, 0], [3, 0], [0, 1]], "at": [0.1, 0.0]},
        "arena.obstacles.0: expected the polygon to lie within the arena of 6 x 4 m",
    ),
    (
        "arena.obstacles.0",
        {"shape": "polygon", "points": [[0, 0], [6.1, 0], [0, 1]], "place": "random"},
        "arena.obstacles.0: expected the polygon to lie within the arena of 6 x 4 m",
    ),
    ("arena.obstacles.0.shape", "ring", "arena.obstacles.0.shape: expected one of box, cylinder, polygon; got 'ring'"),
    (
        "arena.obstacles.0.size_m",
        [1, 1],
        "arena.obstacles.0.size_m: unknown key; expected one of "
        "at, place, count, within, apart_m, height_m, movable, mass_kg, shape, radius_m",
    ),
    ("arena.obstacles.0.at", [1, 1], 'arena.obstacles.0: expected either at = [x, y] or place = "random"'),
    (
        "arena.obstacles.1.count",
        4,
        'arena.obstacles.1: expected place = "random" with a count; at = [x, y] sets only one',
    ),
    ("arena.obstacles.1.at", [2.9, 0], "arena.obstacles.1: expected the box to lie within the arena of 6 x 4 m"),
    ("arena.obstacles.0.radius_m", 3, "arena.obstacles.0: expected the cylinder to lie within the arena of 6 x 4 m"),
    ("robots", {}, "robots: expected a table that is not empty, got {}"),
    (
        "robots.9x",
        SAMPLE["robots"]["big"],
        "robots.9x: expected a name of at most 40 letters, digits and _ that starts with a letter, got '9x'",
    ),
    ("robots.flock.count", "x", f"robots.flock.count: {COUNT}, got 'x'"),
    ("robots.flock.count", 0, f"robots.flock.count: {COUNT}, got 0"),
    ("robots.flock.count", True, f"robots.flock.count: {COUNT}, got True"),
    (
        "robots.flock.body",
        "\0.toml",
        "robots.flock.body: expected the name of a body or of a file, got a text with a zero byte",
    ),
    ("robots.flock.body", "car", f"robots.flock.body: expected one of {', '.join(body_names())}; got 'car'"),
    (
        "robots.flock.colour",
        "red",
        "robots.flock.colour: unknown key; expected one of body, sheet, count, agent, act_every_ticks, params, radio, "
        "place",
    ),
    (
        "robots.flock.place",
        "random",
        "robots.flock.place: expected a table with how = one of arena, box, disc, grid, poses, ring; got 'random'",
    ),
    ("robots.count", 3, "robots.count: expected a table for each group, [robots.GROUP], got 3"),
    (
        "radio.preset",
        "wifi",
        "radio.preset: expected one of ideal, disk, bernoulli, gilbert, argos-rab, infrared-epuck, ieee802154, "
        "wifi-b-1M, wifi-a-6M, ble-1M, gz-rfcomms, subt, kilobot, acoustic (did you mean wifi-b-1M?), got 'wifi'",
    ),
    (
        "physics.engine",
        "disc",
        "physics.engine: expected one of auto, discs, pymunk, kinematic (did you mean discs?), got 'disc'",
    ),
    (
        "robots.flock.place",
        {},
        "robots.flock.place.how: is missing; expected one of arena, box, disc, grid, poses, ring",
    ),
    (
        "robots.flock.place.how",
        "heap",
        "robots.flock.place.how: expected one of arena, box, disc, grid, poses, ring; got 'heap'",
    ),
    (
        "robots.flock.place",
        {"how": "ring", "inner_radius_m": 2.0, "radius_m": 1.0},
        "robots.flock.place: expected an inner_radius_m of at most radius_m, 1.0; got 2.0",
    ),
    ("robots.flock.place.apart_m", -1, f"robots.flock.place.apart_m: {GAP}, got -1"),
    ("robots.flock.place.heading_rad", "east", f"robots.flock.place.heading_rad: {HEADING}, got 'east'"),
    ("robots.flock.place.radius_m", "a", f"robots.flock.place.radius_m: {NUMBER}, got 'a'"),
    (
        "robots.flock.place",
        {"how": "poses", "poses": [[0, 0, 0]]},
        "robots.flock: expected a pose for each of the 12 robots, got 1 poses",
    ),
    ("radio.loss", 2, "radio.loss: expected a number of at least 0 and at most 1, got 2"),
    ("radio.model", "x", "radio.model: expected one of disk, log-distance, friis, two-ray, itu-indoor, got 'x'"),
    ("radio.gives.range.noise_m", -1, "radio.gives.range.noise_m: expected a number of at least 0 (m), got -1"),
    ("radio.send_offset", "x", f"radio.send_offset: {OFFSET}; got 'x'"),
    ("radio.send_offset", 0.1, f"radio.send_offset: {OFFSET}; got 0.1"),
    ("run.on_runner_loss", "hope", "run.on_runner_loss: expected one of stop, dead, wait, stand, coast, got 'hope'"),
    ("run.watchdog_s", 0, "run.watchdog_s: expected a number above 0 and at most 86400 (s), got 0"),
    (
        "wind",
        [],
        "wind: unknown key; expected one of "
        "format, name, seed, duration_s, time, physics, arena, robots, radio, events, "
        "standard_metrics, metrics, stop, run",
    ),
]


@pytest.mark.parametrize(("path", "value", "text"), FAULTS)
def test_a_fault_is_one_line_with_file_key_and_what_was_expected(path: str, value: Any, text: str) -> None:
    with pytest.raises(BadInput) as caught:
        scenario_from(changed(path, value), "file.toml")
    assert str(caught.value) == f"file.toml: {text}"


def test_a_missing_key_says_what_it_should_hold() -> None:
    with pytest.raises(BadInput) as caught:
        scenario_from(without("robots.flock.count"), "file.toml")
    assert str(caught.value) == f"file.toml: robots.flock.count: is missing; {COUNT}"


def test_an_arena_has_a_size_or_a_map() -> None:
    with pytest.raises(BadInput) as caught:
        scenario_from(without("arena.size_m"), "file.toml")
    expected = "expected a list of 2 numbers above 0 and at most 10000 (m), or a map"
    assert str(caught.value) == f"file.toml: arena.size_m: is missing; {expected}"


def test_the_keys_of_further_faults_are_named_up_to_six() -> None:
    mapping = {**changed("seed", -1), "name": "", "duration_s": 0}
    with pytest.raises(BadInput, match=r"^f: name: expected .*, got '' \(also wrong: seed, duration_s\)$"):
        scenario_from(mapping, "f")
    with pytest.raises(BadInput, match=r"\(also wrong: b, c, d, e, f, g, …\)$"):
        scenario_from({**SAMPLE, **dict.fromkeys("abcdefgh", 1)}, "f")


def test_the_radio_comes_out_as_the_contract_s_dataclass() -> None:
    radio = scenario_from(SAMPLE, "f").radio
    assert radio == Radio(range_m=2.0, loss=0.3, gives=Gives(RangeGiven(0.02), BearingGiven(0.0)))
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


OVERRIDE_FAULTS = [
    ("robots.flok.count=3", "--set robots.flok.count=3: robots.flok.body: is missing; expected a text"),
    ("radio={}", "--set radio={}: radio.range_m: is missing"),
    ("robots.flock.count=many", f"--set robots.flock.count=many: robots.flock.count: {COUNT}, got 'many'"),
    ("radio.foo=1", "--set radio.foo=1: radio.foo: unknown key; expected one of range_m"),
    ("seed", "--set seed: expected path=value, such as robots.flock.count=30"),
    ("name.x=1", "--set name.x=1: name.x: name holds no keys"),
    ("arena.obstacles.3.radius_m=1", "arena.obstacles.3: expected a place in a list of 1, counted from 0"),
]


@pytest.mark.parametrize(("override", "text"), OVERRIDE_FAULTS)
def test_a_faulty_override_is_named(tmp_path: Path, override: str, text: str) -> None:
    path = written(tmp_path, MINIMAL + "radio = { range_m = 1 }\n")
    with pytest.raises(BadInput) as caught:
        load_scenario(path, [override])
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_an_override_does_not_touch_is_the_file_s_fault(tmp_path: Path) -> None:
    path = written(tmp_path, MINIMAL.replace("count = 2", "count = 0"))
    with pytest.raises(BadInput, match=r"s.toml: robots.flock.count: expected"):
        load_scenario(path, ["robots.flock.body=footbot"])


def test_a_mark_of_byte_order_before_the_text_does_no_harm(tmp_path: Path) -> None:
    assert load_scenario(written(tmp_path, "\ufeff" + MINIMAL)).name == "small"


def test_unreadable_files_are_bad_input_too(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"none.toml: expected a readable file: No such file or directory$"):
        load_scenario(tmp_path / "none.toml")
    with pytest.raises(BadInput, match=r"s.toml: expected TOML: Invalid value \(at line 1, column 8\)$"):
        load_scenario(written(tmp_path, "seed = x"))
    (tmp_path / "s.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(BadInput, match="expected TOML, which is UTF-8 text$"):
        load_scenario(tmp_path / "s.toml")


def test_a_scenario_cannot_be_changed() -> None:
    scenario = scenario_from(SAMPLE, "f")
    with pytest.raises(ValueError, match="frozen"):
        scenario.seed = 4  # pyright: ignore[reportAttributeAccessIssue] - frozen: that is what is tested
    assert isinstance(scenario, Scenario)
