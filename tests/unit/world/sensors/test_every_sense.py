"""What holds of every sense there is, with all that can go wrong with it: an arena alone, seldom looked at, failed."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.plugins import NotLoaded
from swarmwire.comms.sensors import SENSOR_SPECS, Sensors
from swarmwire.comms.sensors.sensor import RangedSensorSpec, SensorSpec
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.sensors.loading import truth_of
from swarmwire.world.sensors.sensor import BuiltInSensor
from swarmwire.world.world import World
from tests.support.world.samples import commanded

STAGES: dict[str, Any] = {"rate_hz": 4.0, "delay_s": 0.15, "drop_out": 0.2}
OUTLIER: dict[str, Any] = {"outlier": 0.1, "step": 0.01}
SPECS = {
    name: replace(kind.example(), **STAGES, **(OUTLIER if issubclass(kind, RangedSensorSpec) else {}))
    for name, kind in SENSOR_SPECS.items()
}
OWN = f"{Path(__file__).parents[3] / 'support' / 'world' / 'custom_code.py'}:Alone"
NAMES = (*SPECS, "own")


def body() -> str:
    """A sheet with an example of every sensor."""
    tables = {**{name: asdict(spec) for name, spec in SPECS.items()}, "own": {"kind": OWN, **STAGES}}
    return "\n".join(['like = "epuck"', *(f"sensors.{name} = {toml(table)}" for name, table in tables.items())])


def toml(value: Any) -> str:
    """An inline value of TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + " }"
    return json.dumps(value)


def world(folder: Path, seeds: tuple[int, ...] = (1,), every: int = 1) -> World:
    """Nine robots with lit LEDs, crowded between lights."""
    (folder / "all.toml").write_text(body())
    arena = {"size_m": [0.5, 0.5], "lights": [{"intensity": 2.0, "place": "random", "count": 2}]}
    group = {"body": "all.toml", "count": 9, "agent": "x:X", "act_every_ticks": every}
    tables = {"arena": arena, "robots": {"a": group}}
    scenario = scenario_from({"format": 1, "name": "t", "seed": 1, "duration_s": 1.0, **tables}, str(folder / "s.toml"))
    of = World(scenario, seeds, {"a": NAMES})
    of.scene.leds[:] = 0x00FF00
    return of


def moved(of: World, tick: int) -> None:
    """All drive some way, which is the same in each arena."""
    robot = np.arange(of.static.arenas * of.static.robots) % of.static.robots
    of.move(commanded(of, 0.1 * np.sin(tick + robot), np.cos(robot)))


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What all sensors read in each of 13 ticks, two arenas side by side."""
    of, read = world(tmp_path_factory.mktemp("told"), (1, 2)), list[dict[str, Any]]()
    for tick in range(13):
        read.append(of.sense(tick)["a"].fields)
        moved(of, tick)
    return read


@pytest.mark.parametrize("name", SENSOR_SPECS)
def test_the_fields_of_a_spec_are_those_of_its_reading_its_truth_and_its_synthetic_values(name: str) -> None:
    spec, declared = SPECS[name], getattr(Sensors, name)
    fields = spec.reading_fields()
    assert declared.columns == tuple(f"{name}.{field.name}" for field in fields)
    assert truth_of(declared.spec) is not BuiltInSensor
    made = spec.synthetic(name, 3, lambda _, width: np.full((5, width) if width else 5, 0.25))
    for field, values, blank in zip(fields, made, spec.blank(name, 5).values(), strict=True):
        assert values.shape == blank.shape == ((5, field.width) if field.width else (5,))
        finite = values[np.isfinite(values)]
        assert ((field.low <= finite) & (finite <= field.high)).all()
        assert bool(field.per) == bool(field.width)
        assert field.help


def test_a_declaration_without_its_truth_is_refused() -> None:
    class Lost(SensorSpec):
        truth = "swarmwire.world.sensors.imu:Lost"

    class Other(SensorSpec):
        truth = "swarmwire.world.sensors.sensor:Scene"

    with pytest.raises(NotLoaded, match="holds no such name: 'Lost'"):
        truth_of(Lost)
    with pytest.raises(TypeError, match="expected a BuiltInSensor"):
        truth_of(Other)


@pytest.mark.parametrize("name", NAMES)
def test_some_readings_are_there_and_some_are_lost(told: list[dict[str, Any]], name: str) -> None:
    fields = [field for field in told[0] if field.startswith(f"{name}.")]
    assert fields
    for field in fields:
        first, later = told[0][field], np.stack([tick[field] for tick in told[3:]])
        assert first.flags.c_contiguous
        assert len(np.unique(first)) == 1  # nothing was shown so far: all are blank
        assert len(np.unique(later)) > 1


@pytest.mark.parametrize("over", [0, 1])
def test_an_arena_senses_the_same_once_another_has_left(tmp_path: Path, told: list[dict[str, Any]], over: int) -> None:
    of, kept = world(tmp_path, (1, 2)), slice(0, 9) if over else slice(9, 18)
    for tick, expected in enumerate(told):
        if tick == 5:
            of.leave(np.arange(2) == over)
        readings = of.sense(tick)["a"]
        assert readings.rows.tolist() == list(range(18) if tick < 5 else range(18)[kept])
        for field, values in readings.fields.items():
            np.testing.assert_array_equal(values[-9:] if over == 0 else values[:9], expected[field][kept])
        moved(of, tick)


def test_an_arena_alone_senses_what_it_senses_among_others(tmp_path: Path, told: list[dict[str, Any]]) -> None:
    alone = world(tmp_path, (2,))
    for tick in range(13):
        for field, values in alone.sense(tick)["a"].fields.items():
            assert np.array_equal(values, told[tick][field][9:], equal_nan=True), field
        moved(alone, tick)


def test_how_often_a_group_looks_changes_nothing(tmp_path: Path, told: list[dict[str, Any]]) -> None:
    seldom = world(tmp_path, (1, 2), every=4)
    for tick in range(13):
        read = seldom.sense(tick)
        assert bool(read) == (tick % 4 == 0)
        for field, values in (read["a"].fields if read else {}).items():
            assert np.array_equal(values, told[tick][field], equal_nan=True), field
        moved(seldom, tick)


def test_a_sensor_that_failed_reads_blank_and_all_others_go_on(tmp_path: Path, told: list[dict[str, Any]]) -> None:
    of = world(tmp_path, (1, 2))
    for tick in range(13):
        for sensor in of.sensors["a"].values():
            sensor.failed = np.arange(18).reshape(2, 9) % 3 == 0 if tick == 12 else None
        read = of.sense(tick)["a"].fields
        if tick == 12:
            for field, values in read.items():
                blank = told[0][field][0]
                assert np.array_equal(values[::3], np.broadcast_to(blank, values[::3].shape), equal_nan=True), field
                assert np.array_equal(values[1::3], told[12][field][1::3], equal_nan=True), field
        moved(of, tick)
