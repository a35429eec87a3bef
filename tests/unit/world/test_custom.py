"""Custom sensors and actuators."""

from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.errors import CustomCodeFailed
from swarmwire.comms.robot.bodies.body import body_from, body_from_mapping, load_body
from swarmwire.comms.robot.tick_io import Actions, SparseTable
from swarmwire.world.custom import Field, Noise
from swarmwire.world.scenario.bodies import fitted
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support import custom_code
from tests.support.refusals import refused_input
from tests.support.world.scenes import commanded

CODE = Path(__file__).parents[2] / "support" / "custom_code.py"
PAINT, PAINTER = f"{CODE}:Paint", f"{CODE}:Painter"
BOTH = f'''like = "epuck"
name = "mine"
[sensors.paint]
kind = "{PAINT}"
scale = 2.0
[actuators.painter]
kind = "{PAINTER}"
'''
SENSOR, ACTUATOR = "[sensors.x]\nkind = ", "[actuators.x]\nkind = "
UNKNOWN: Any = "gaussian"
SHEET: dict[str, Any] = {"like": "epuck", "sensors": {"x": {"kind": "tests.support.custom_code:Alone"}}}


def scenario(folder: Path, spec: str, count: int = 2) -> Scenario:
    """Robots with this body, on a line."""
    (folder / "mine.toml").write_text(spec)
    poses = [[0.5 * i, 0.0, 0.0] for i in range(count)]
    group = {"body": "mine.toml", "count": count, "agent": "x:X", "place": {"how": "poses", "poses": poses}}
    tables = {"arena": {"size_m": [4.0, 4.0]}, "robots": {"a": group}}
    return scenario_from({"format": 1, "name": "t", "seed": 1, "duration_s": 1.0, **tables}, str(folder / "s.toml"))


def world(folder: Path, spec: str = BOTH, seeds: tuple[int, ...] = (1,), needs: tuple[str, ...] = ("paint",)) -> World:
    return World(scenario(folder, spec), seeds, {"a": needs})


def actuated(built: World, rows: list[int], slot: list[int], value: list[float], speed: float = 0.0) -> Actions:
    commands = SparseTable(np.array(rows), np.array(slot), np.array(value))
    return replace(commanded(built, speed, 0.0), actuators=commands)


def test_custom_sensor_reads_the_effect_of_a_custom_actuator(tmp_path: Path) -> None:
    built = world(tmp_path, seeds=(1, 2))
    fields = built.sense(0)["a"].fields
    assert fields["paint.amount"].tolist() == [0.0] * 4
    assert fields["paint.ticks"].tolist() == [[0.0] * 3] * 4
    built.move(actuated(built, [1, 1, 2, 2], [0, 1, 0, 1], [0.0, 0.5, 0.0, 0.25]))
    assert built.sense(1)["a"].fields["paint.amount"].tolist() == [0.0, 1.0, 0.5, 0.0]
    built.move(commanded(built, 0.0, 0.0))
    assert built.sense(2)["a"].fields["paint.amount"].tolist() == [0.0, 1.0, 0.5, 0.0]


def test_custom_code_is_equal_for_an_arena_alone_and_among_others(tmp_path: Path) -> None:
    noisy = BOTH.replace("scale = 2.0", "scale = 2.0\nnoise = 0.1\ndrop_out = 0.3\nstep = 0.01")
    both, alone = (world(tmp_path, noisy, seeds) for seeds in ((1, 2), (2,)))
    for tick in range(5):
        together, by_itself = both.sense(tick)["a"].fields, alone.sense(tick)["a"].fields
        for name, values in by_itself.items():
            assert np.array_equal(values, together[name][2:], equal_nan=True)
        both.move(actuated(both, [2, 2], [0, 1], [0.0, 0.5]))
        alone.move(actuated(alone, [0, 0], [0, 1], [0.0, 0.5]))


def test_custom_sensor_has_the_shared_keys(tmp_path: Path) -> None:
    late = world(tmp_path, BOTH.replace("scale", "delay_s = 0.2\nscale"))
    ticks: list[float] = []
    for tick in range(4):
        ticks.append(late.sense(tick)["a"].fields["paint.ticks"][0, 0])
        late.move(commanded(late, 0.0, 0.0))
    assert ticks == [-1.0, -1.0, 0.0, 1.0]


def test_custom_actuator_changes_the_target_of_the_engine(tmp_path: Path) -> None:
    built = world(tmp_path)
    for _ in range(5):
        built.move(actuated(built, [0, 0], [0, 1], [-1.0, 0.0], speed=0.1))
    assert built.pose[0, 0] == 0.0
    assert built.pose[1, 0] > 0.53


def test_custom_actuator_of_a_dead_robot_or_missing_slot_does_nothing(tmp_path: Path) -> None:
    built = world(tmp_path)
    built.set_alive(np.array([False, True]))
    built.move(actuated(built, [0, 0, 1, 1, 1], [0, 1, 0, 1, 2], [0.0, 1.0, 0.0, 1.0, 1.0]))
    assert built.sense(1)["a"].fields["paint.amount"].tolist() == [2.0]
    assert built.scene.shared["painted"].tolist() == [[0.0, 1.0]]
    assert built.counts()["actuators_not_there"].sum() == 1


def test_custom_sensor_with_one_field_needs_no_tuple(tmp_path: Path) -> None:
    built = world(tmp_path, f'like = "epuck"\n[sensors.x]\nkind = "{CODE}:Alone"\n', needs=("x",))
    reading = built.sense(0)["a"].fields["x.x"]
    reading[:] = 9.0
    assert built.sense(1)["a"].fields["x.x"].tolist() == [0.0, 0.5]


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("Raises", "ZeroDivisionError"),
        ("WrongShape", r"expected x of shape \(1, 2\), got \(3,\)"),
        ("TellsNothing", "expected an array, or a tuple of arrays, got None"),
        ("TellsANumber", "expected an array, or a tuple of arrays, got 3"),
        ("TellsWords", "expected numbers as x: could not convert"),
    ],
)
def test_custom_sensor_that_fails_is_named(tmp_path: Path, name: str, fault: str) -> None:
    built = world(tmp_path, f'like = "epuck"\n[sensors.x]\nkind = "{CODE}:{name}"\n', needs=("x",))
    with pytest.raises(CustomCodeFailed, match=rf"the sense x of a \(.*custom_code.py:{name}\) failed:[\s\S]*{fault}"):
        built.sense(0)


def test_custom_sensor_may_read_nan(tmp_path: Path) -> None:
    built = world(tmp_path, f'like = "epuck"\n[sensors.x]\nkind = "{CODE}:TellsNan"\n', needs=("x",))
    assert np.isnan(built.sense(0)["a"].fields["x.x"]).all()


def test_custom_actuator_that_fails_is_named(tmp_path: Path) -> None:
    built = world(tmp_path, f'like = "epuck"\n[actuators.x]\nkind = "{CODE}:Breaks"\n', needs=())
    with pytest.raises(CustomCodeFailed, match=r"the actuator x of a \(.*Breaks\) failed:[\s\S]*jammed"):
        built.move(commanded(built, 0.0, 0.0))


@pytest.mark.parametrize("where", ["target", "charge"])
@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_custom_actuator_that_writes_non_finite_values_is_named(tmp_path: Path, where: str, value: str) -> None:
    bursts = f'[actuators.x]\nkind = "{CODE}:Bursts"\nwhere = "{where}"\nvalue = "{value}"\n'
    built = world(tmp_path, BOTH + bursts, needs=())
    built.move(commanded(built, 0.1, 0.0))
    fault = rf"finite numbers in scene.{where}, got .*{value}.* of robot 1 in arena 0"
    with pytest.raises(CustomCodeFailed, match=rf"the actuator x of a \(.*Bursts\) failed:\n.*{fault}"):
        built.move(commanded(built, 0.1, 0.0))


def test_leds_switched_by_a_custom_actuator_are_published(tmp_path: Path) -> None:
    built = world(tmp_path, f'like = "epuck"\n[actuators.x]\nkind = "{CODE}:Flashes"\n', needs=())
    before = built.actuators.leds.published
    built.move(actuated(built, [1], [0], [255.0]))
    lit = built.actuators.leds.published
    assert lit[:, 0].tolist() == [0, 255]
    built.move(commanded(built, 0.0, 0.0))
    assert built.actuators.leds.published is lit
    built.move(actuated(built, [1], [0], [0.0]))
    assert not built.actuators.leds.published.any()
    assert (before.any(), lit[1, 0]) == (False, 255)  # published arrays are not written to


def test_custom_code_may_use_the_key_names_of_sheets(tmp_path: Path) -> None:
    sensor = f'[sensors.x]\nkind = "{CODE}:Keyed"\nparams = 2\nany = [{{a = 1}}, "b", false, -0.5]\n'
    actuator = f'[actuators.x]\nkind = "{CODE}:Wide"\nwidth = 3\nparams = 4\n'
    body = world(tmp_path, f'like = "epuck"\n{sensor}{actuator}', needs=("x",)).static.groups[0].body
    assert (body.sensors["x"].params, body.sensors["x"].fields) == (
        {"params": 2, "any": [{"a": 1}, "b", False, -0.5]},
        {"x": 0},
    )
    assert (body.actuators["x"].params, body.actuators["x"].width) == ({"width": 3, "params": 4}, 3)
    assert body_from_mapping(body.as_mapping(), "static.json") == body


BAD_CODE = {
    "sensors.x.kind": [
        *(SENSOR + value for value in ('"none.py:X"', '"json:Nothing"', '"nonsense"', "3", f'"{PAINTER}"')),
        *(SENSOR + f'"{CODE}:{name}"' for name in ("NOTHING", "NoTruth", "NoFields", "Twice", "Frozen", "WideField")),
    ],
    "actuators.x.kind": [
        *(ACTUATOR + f'"{CODE}:{name}"' for name in ("Paint", "NoWidth", "TooWide")),
        "[actuators.x]\ngain = 1",
    ],
    "sensors.x": [SENSOR + f'"{CODE}:Refuses"', "[sensors.x]\nscale = 1"],
    "sensors.x.y": ['[sensors."x.y"]\nkind = "a"'],
    "actuators.x y": ['[actuators."x y"]\nkind = "a:B"'],
    "sensors.x.scale": [SENSOR + f'"{PAINT}"\nscale = {value}' for value in ("0", '"a"')],
    "sensors.x.cells": [SENSOR + f'"{PAINT}"\ncells = {value}' for value in ("1.5", "0")],
    "sensors.x.size": [SENSOR + f'"{PAINT}"\nsize = 1'],
    "sensors.x.delay_s": [SENSOR + f'"{PAINT}"\ndelay_s = -1'],
    "sensors.x.params": [SENSOR + f'"{PAINT}"\nparams = {{}}\nfields = {{}}'],
    "actuators.x.gain": [ACTUATOR + f'"{PAINTER}"\ngain = -1'],
    "actuators.x.params": [ACTUATOR + f'"{PAINTER}"\nparams = {{}}\nwidth = 2'],
    **{f"sensors.{part}": [f'[sensors.{part}]\nkind = "{PAINT}"'] for part in ("motors", "left_wheel", "right_wheel")},
    **{
        key + inner: [f"{table}any = {value}" for value in values]
        for key, table in (
            ("sensors.x.any", SENSOR + f'"{CODE}:Keyed"\n'),
            ("actuators.x.any", ACTUATOR + f'"{CODE}:Wide"\n'),
        )
        for inner, values in (
            ("", ("2026-01-02", "0x1_0000_0000_0000_0000")),
            ("[1].a", ("[0, {a = 10:20:30}]",)),
            ("[1]", ("[1.0, inf]",)),
        )
    },
}


@pytest.mark.parametrize(("key", "table"), [(key, table) for key, tables in BAD_CODE.items() for table in tables])
def test_bad_custom_code_is_refused_with_its_key(tmp_path: Path, key: str, table: str) -> None:
    with refused_input(tmp_path / "mine.toml", key):
        scenario(tmp_path, f'like = "epuck"\n{table}\n')


def test_custom_sensor_of_an_entry_point_is_loaded_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    points = {"painted": "Paint"}
    custom_code.install(tmp_path / "site", "painted_code", points, CODE.read_text(), "swarmwire.sensors")
    monkeypatch.syspath_prepend(tmp_path / "site")
    built = world(tmp_path, 'like = "epuck"\n[sensors.mine]\nkind = "painted"\nscale = 3.0\n', needs=("mine",))
    assert built.sense(0)["a"].fields["mine.ticks"].shape == (2, 3)
    assert built.static.groups[0].body.sensors["mine"].kind == "painted_code:Paint"


def test_agent_view_has_names_and_widths_but_no_classes_or_keys(tmp_path: Path) -> None:
    body = world(tmp_path).static.groups[0].body
    spec = body.sensors["paint"]
    assert (spec.fields, spec.params) == ({"amount": 0, "ticks": 3}, {"scale": 2.0})
    view = body_from_mapping(body.agent_view.as_mapping(), "assignment")
    assert (view.sensors["paint"].fields, view.sensors["paint"].params) == ({"amount": 0, "ticks": 3}, {})
    assert (view.actuators["painter"].width, view.actuators["painter"].params) == (2, {})
    assert (view.sensors["paint"].kind, view.actuators["painter"].kind) == ("", "")
    assert str(CODE.parent) not in str(view.as_mapping())
    assert body_from_mapping(body.as_mapping(), "static.json") == body
    assert load_body("epuck").agent_view == load_body("epuck")


def fit(monkeypatch: pytest.MonkeyPatch, *fields: Field) -> dict[str, int]:
    """The fields of a custom sensor as agents see them."""
    monkeypatch.setattr(custom_code.Alone, "fields", fields)
    spec: Any = fitted(body_from(SHEET, "mine.toml"), "mine.toml").sensors["x"]
    return spec.fields


BAD_FIELDS: dict[str, list[Any]] = {
    "step": [nan, -0.1, "0.1", True],
    "low": [nan],
    "high": [None, -2.0],
    "blank": [None],
    "noise": [0.1, Noise(kind=UNKNOWN), Noise(size=-1.0), Noise(relative=inf)],
    "width": [-1, 1.5],
    "span": [(1.0, 0.0), (0.0, inf), 3],
    "unit": [1],
    "help": [None],
    "per": [2.0],
}


@pytest.mark.parametrize(("key", "value"), [(key, value) for key, values in BAD_FIELDS.items() for value in values])
def test_impossible_custom_field_is_refused(monkeypatch: pytest.MonkeyPatch, key: str, value: Any) -> None:
    with refused_input("mine.toml", "sensors.x.kind", f"the field b of Alone: expected .*{key}"):
        fit(monkeypatch, Field("a"), Field("b", **{"low": -1.0, key: value}))


@pytest.mark.parametrize("name", ["", "a b", 3])
def test_custom_field_without_a_valid_name_is_refused(monkeypatch: pytest.MonkeyPatch, name: Any) -> None:
    with refused_input(key="sensors.x.kind"):
        fit(monkeypatch, Field("a"), Field(name))


def test_custom_fields_at_their_limits_are_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    noise: Any = Noise("uniform", 0, np.float32(0.5))
    fields = fit(monkeypatch, Field("a", 2, noise, 0, -inf, 1, blank=-1), Field("b", low=1.0, high=1.0, span=(0, 0)))
    assert fields == {"a": 2, "b": 0}
