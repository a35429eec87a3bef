"""Custom sensors and actuators."""

import re
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.errors import BadInput, CustomCodeFailed
from swarmwire.comms.robot.bodies.body import body_from, body_from_mapping, load_body
from swarmwire.comms.robot.bodies.custom import MAX_WIDTH, CustomSensorSpec
from swarmwire.comms.robot.tick_io import Actions, SparseTable
from swarmwire.world.custom import Field, Noise
from swarmwire.world.custom.actuators import custom_actuator
from swarmwire.world.scenario.bodies import fitted, read_body
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.sensors.loading import custom_sensor
from swarmwire.world.world import World
from tests.support import custom_code
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


def actuated(of: World, rows: list[int], place: list[int], value: list[float], speed: float = 0.0) -> Actions:
    commands = SparseTable(np.array(rows), np.array(place), np.array(value))
    return replace(commanded(of, speed, 0.0), actuators=commands)


def test_an_own_sense_tells_what_an_own_actuator_did(tmp_path: Path) -> None:
    of = world(tmp_path, seeds=(1, 2))
    told = of.sense(0)["a"].fields
    assert told["paint.amount"].tolist() == [0.0] * 4
    assert told["paint.ticks"].tolist() == [[0.0] * 3] * 4
    of.move(actuated(of, [1, 1, 2, 2], [0, 1, 0, 1], [0.0, 0.5, 0.0, 0.25]))
    assert of.sense(1)["a"].fields["paint.amount"].tolist() == [0.0, 1.0, 0.5, 0.0]
    of.move(commanded(of, 0.0, 0.0))
    assert of.sense(2)["a"].fields["paint.amount"].tolist() == [0.0, 1.0, 0.5, 0.0]


def test_a_sheets_own_code_is_made_with_its_parameters(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(BOTH)
    body = read_body(tmp_path / "mine.toml", "s.toml", "robots.a.body")
    paint, painter = body.sensors["paint"], body.actuators["painter"]
    assert isinstance(paint, CustomSensorSpec)
    made: Any = custom_sensor(paint)
    assert (type(made).__name__, made.scale) == ("Paint", 2.0)
    assert type(custom_actuator(painter)).__name__ == "Painter"
    assert custom_actuator(painter) is not custom_actuator(painter)


def test_an_arena_is_the_same_alone_and_among_others(tmp_path: Path) -> None:
    noisy = BOTH.replace("scale = 2.0", "scale = 2.0\nnoise = 0.1\ndrop_out = 0.3\nstep = 0.01")
    both, alone = (world(tmp_path, noisy, seeds) for seeds in ((1, 2), (2,)))
    for tick in range(5):
        together, by_itself = both.sense(tick)["a"].fields, alone.sense(tick)["a"].fields
        for name, values in by_itself.items():
            assert np.array_equal(values, together[name][2:], equal_nan=True)
        both.move(actuated(both, [2, 2], [0, 1], [0.0, 0.5]))
        alone.move(actuated(alone, [0, 0], [0, 1], [0.0, 0.5]))


def test_shared_keys_hold_for_own_senses_too(tmp_path: Path) -> None:
    late = world(tmp_path, BOTH.replace("scale", "delay_s = 0.2\nscale"))
    ticks: list[float] = []
    for tick in range(4):
        ticks.append(late.sense(tick)["a"].fields["paint.ticks"][0, 0])
        late.move(commanded(late, 0.0, 0.0))
    assert ticks == [-1.0, -1.0, 0.0, 1.0]


def test_an_actuator_may_change_what_the_engine_is_given(tmp_path: Path) -> None:
    of = world(tmp_path)
    for _ in range(5):
        of.move(actuated(of, [0, 0], [0, 1], [-1.0, 0.0], speed=0.1))
    assert of.pose[0, 0] == 0.0
    assert of.pose[1, 0] > 0.53


def test_the_dead_do_nothing_and_places_that_are_not_there_are_counted(tmp_path: Path) -> None:
    of = world(tmp_path)
    of.set_alive(np.array([False, True]))
    of.move(actuated(of, [0, 0, 1, 1, 1], [0, 1, 0, 1, 2], [0.0, 1.0, 0.0, 1.0, 1.0]))
    assert of.sense(1)["a"].fields["paint.amount"].tolist() == [2.0]
    assert of.scene.shared["painted"].tolist() == [[0.0, 1.0]]
    assert of.counts()["actuators_not_there"].sum() == 1


def test_one_field_needs_no_tuple_and_is_copied(tmp_path: Path) -> None:
    of = world(tmp_path, f'like = "epuck"\n[sensors.x]\nkind = "{CODE}:Alone"\n', needs=("x",))
    told = of.sense(0)["a"].fields["x.x"]
    told[:] = 9.0
    assert of.sense(1)["a"].fields["x.x"].tolist() == [0.0, 0.5]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Raises", "ZeroDivisionError"),
        ("WrongShape", r"expected x of shape \(1, 2\), got \(3,\)"),
        ("TellsNothing", "expected an array, or a tuple of arrays, got None"),
        ("TellsANumber", "expected an array, or a tuple of arrays, got 3"),
        ("TellsWords", "expected numbers as x: could not convert"),
    ],
)
def test_a_sense_that_fails_says_which_it_is(tmp_path: Path, name: str, said: str) -> None:
    of = world(tmp_path, f'like = "epuck"\n[sensors.x]\nkind = "{CODE}:{name}"\n', needs=("x",))
    with pytest.raises(CustomCodeFailed, match=rf"the sense x of a \(.*custom_code.py:{name}\) failed:[\s\S]*{said}"):
        of.sense(0)


def test_a_sense_may_tell_that_it_knows_nothing(tmp_path: Path) -> None:
    of = world(tmp_path, f'like = "epuck"\n[sensors.x]\nkind = "{CODE}:TellsNan"\n', needs=("x",))
    assert np.isnan(of.sense(0)["a"].fields["x.x"]).all()


def test_an_actuator_that_fails_says_which_it_is(tmp_path: Path) -> None:
    of = world(tmp_path, f'like = "epuck"\n[actuators.x]\nkind = "{CODE}:Breaks"\n', needs=())
    with pytest.raises(CustomCodeFailed, match=r"the actuator x of a \(.*Breaks\) failed:[\s\S]*jammed"):
        of.move(commanded(of, 0.0, 0.0))


@pytest.mark.parametrize("where", ["target", "charge"])
@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_an_actuator_that_writes_what_is_not_finite_is_named(tmp_path: Path, where: str, value: str) -> None:
    bursts = f'[actuators.x]\nkind = "{CODE}:Bursts"\nwhere = "{where}"\nvalue = "{value}"\n'
    of = world(tmp_path, BOTH + bursts, needs=())
    of.move(commanded(of, 0.1, 0.0))
    said = rf"finite numbers in scene.{where}, got .*{value}.* of robot 1 in arena 0"
    with pytest.raises(CustomCodeFailed, match=rf"the actuator x of a \(.*Bursts\) failed:\n.*{said}"):
        of.move(commanded(of, 0.1, 0.0))


def test_observers_are_told_of_leds_that_an_own_actuator_switches(tmp_path: Path) -> None:
    of = world(tmp_path, f'like = "epuck"\n[actuators.x]\nkind = "{CODE}:Flashes"\n', needs=())
    before = of.actuators.leds.published
    of.move(actuated(of, [1], [0], [255.0]))
    lit = of.actuators.leds.published
    assert lit[:, 0].tolist() == [0, 255]
    of.move(commanded(of, 0.0, 0.0))
    assert of.actuators.leds.published is lit
    of.move(actuated(of, [1], [0], [0.0]))
    assert not of.actuators.leds.published.any()
    assert (before.any(), lit[1, 0]) == (False, 255)  # what was told is never written to


def test_keys_of_own_classes_may_be_named_as_those_of_told_sheets(tmp_path: Path) -> None:
    sensor = f'[sensors.x]\nkind = "{CODE}:Keyed"\nparams = 2\nany = [{{a = 1}}, "b", false, -0.5]\n'
    actuator = f'[actuators.x]\nkind = "{CODE}:Wide"\nwidth = 3\nparams = 4\n'
    body = world(tmp_path, f'like = "epuck"\n{sensor}{actuator}', needs=("x",)).static.groups[0].body
    assert (body.sensors["x"].params, body.sensors["x"].fields) == (
        {"params": 2, "any": [{"a": 1}, "b", False, -0.5]},
        {"x": 0},
    )
    assert (body.actuators["x"].params, body.actuators["x"].width) == ({"width": 3, "params": 4}, 3)
    assert body_from_mapping(body.as_mapping(), "static.json") == body


@pytest.mark.parametrize(
    ("table", "said"),
    [
        (SENSOR + '"none.py:X"', "sensors.x.kind: there is no file"),
        (SENSOR + '"json:Nothing"', "sensors.x.kind: json holds no such name: 'Nothing'"),
        (SENSOR + '"nonsense"', 'sensors.x.kind: expected "package.module:Class" or "file.py:Class", got \'nonsense\''),
        (
            SENSOR + "3",
            'sensors.x.kind: expected "file.py:Class", "package.module:Class" or the name of an entry point',
        ),
        (SENSOR + f'"{CODE}:NOTHING"', "sensors.x.kind: expected a dataclass below CustomSensor; .* is 1"),
        (SENSOR + f'"{PAINTER}"', "sensors.x.kind: expected a dataclass below CustomSensor"),
        (SENSOR + f'"{CODE}:NoTruth"', "sensors.x.kind: NoTruth has no truth"),
        (SENSOR + f'"{CODE}:NoFields"', "sensors.x.kind: expected fields as a tuple of Field; NoFields has 'x'"),
        (
            SENSOR + f'"{CODE}:Twice"',
            "sensors.x.kind: expected fields with names of their own, of letters, digits and _; got x, x",
        ),
        (SENSOR + f'"{CODE}:Refuses"', "sensors.x: Refuses refuses: ValueError: no"),
        (SENSOR + f'"{PAINT}"\nscale = 0', "sensors.x.scale: expected more than 0, got 0.0"),
        (SENSOR + f'"{PAINT}"\nscale = "a"', "sensors.x.scale: expected a number, got 'a'"),
        (SENSOR + f'"{PAINT}"\ncells = 1.5', "sensors.x.cells: expected a whole number, got 1.5"),
        (SENSOR + f'"{PAINT}"\ncells = 0', "sensors.x.cells: expected at least 1, got 0"),
        (SENSOR + f'"{PAINT}"\nsize = 1', "sensors.x.size: unknown key; expected one of scale, noise, cells"),
        (SENSOR + f'"{PAINT}"\ndelay_s = -1', "sensors.x.delay_s: expected at least 0 s, got -1.0"),
        (
            "[sensors.x]\nscale = 1",
            'sensors.x: unknown sensor; expected one of .*, or a kind = "file.py:Class" of your own',
        ),
        *(
            (
                f'[sensors.{name}]\nkind = "{PAINT}"',
                f"sensors.{name}: expected another name: {name} is a part of the drive",
            )
            for name in ("motors", "left_wheel", "right_wheel")
        ),
        *(
            (f"{table}any = {value}", f"{key}.any{inner}: expected {expected}")
            for table, key in (
                (SENSOR + f'"{CODE}:Keyed"\n', "sensors.x"),
                (ACTUATOR + f'"{CODE}:Wide"\n', "actuators.x"),
            )
            for value, inner, expected in (
                ("2026-01-02", "", r"a number, text, .*, got datetime.date\(2026, 1, 2\)"),
                ("[0, {a = 10:20:30}]", r"\[1\].a", r"a number, text, .*, got datetime.time"),
                ("[1.0, inf]", r"\[1\]", "a finite number, got inf"),
                ("0x1_0000_0000_0000_0000", "", "a whole number of 64 bits, got one of 65"),
            )
        ),
        ('[sensors."x.y"]\nkind = "a"', "sensors.x.y: unknown sensor"),
        (ACTUATOR + f'"{PAINT}"', "actuators.x.kind: expected a dataclass below CustomActuator"),
        (SENSOR + f'"{CODE}:Frozen"', "sensors.x.kind: expected a dataclass that is not frozen; Frozen is"),
        (ACTUATOR + f'"{CODE}:NoWidth"', "actuators.x.kind: expected a width from 1 to 10000; NoWidth has 0"),
        (
            ACTUATOR + f'"{CODE}:TooWide"',
            f"actuators.x.kind: expected a width from 1 to {MAX_WIDTH}; TooWide has",
        ),
        (SENSOR + f'"{CODE}:WideField"', "sensors.x.kind: the field x of WideField: expected a width from 0 to 10000"),
        (ACTUATOR + f'"{PAINTER}"\ngain = -1', "actuators.x.gain: expected more than 0, got -1.0"),
        ("[actuators.x]\ngain = 1", "actuators.x.kind: is missing"),
        (SENSOR + f'"{PAINT}"\nparams = {{}}\nfields = {{}}', "sensors.x.params: unknown key; expected one of scale"),
        (ACTUATOR + f'"{PAINTER}"\nparams = {{}}\nwidth = 2', "actuators.x.params: unknown key; expected one of gain"),
        ('[actuators."x y"]\nkind = "a:B"', "actuators.x y: expected a name of letters"),
    ],
)
def test_bad_own_code_is_refused_with_file_key_and_reason(tmp_path: Path, table: str, said: str) -> None:
    with pytest.raises(BadInput, match=rf"^{tmp_path}/mine.toml: {said}"):
        scenario(tmp_path, f'like = "epuck"\n{table}\n')


def test_a_body_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    group = {"body": "none.toml", "count": 1, "agent": "x:X"}
    tables = {"arena": {"size_m": [4.0, 4.0]}, "robots": {"a": group}}
    with pytest.raises(BadInput, match="robots.a.body: expected a readable file: .*none.toml: No such file"):
        scenario_from({"format": 1, "name": "t", "seed": 1, "duration_s": 1.0, **tables}, str(tmp_path / "s.toml"))
    with pytest.raises(BadInput, match=r"mine.toml: expected TOML: "):
        scenario(tmp_path, "like = ")


def test_a_need_that_the_body_lacks_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="the agent needs the sense 'gas'; the body mine has proximity, .*, paint"):
        world(tmp_path, needs=("gas",))


def test_an_entry_point_is_a_kind_of_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    info = tmp_path / "site" / "mine-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[swarmwire.sensors]\npainted = painted_code:Paint\n")
    (tmp_path / "site" / "painted_code.py").write_text(CODE.read_text())
    monkeypatch.syspath_prepend(tmp_path / "site")
    of = world(tmp_path, 'like = "epuck"\n[sensors.mine]\nkind = "painted"\nscale = 3.0\n', needs=("mine",))
    assert of.sense(0)["a"].fields["mine.ticks"].shape == (2, 3)
    assert of.static.groups[0].body.sensors["mine"].kind == "painted_code:Paint"


def test_agents_know_names_and_widths_and_nothing_of_classes_and_keys(tmp_path: Path) -> None:
    body = world(tmp_path).static.groups[0].body
    spec = body.sensors["paint"]
    assert (spec.fields, spec.params) == ({"amount": 0, "ticks": 3}, {"scale": 2.0})
    told = body_from_mapping(body.agent_view.as_mapping(), "assignment")
    assert (told.sensors["paint"].fields, told.sensors["paint"].params) == ({"amount": 0, "ticks": 3}, {})
    assert (told.actuators["painter"].width, told.actuators["painter"].params) == (2, {})
    assert (told.sensors["paint"].kind, told.actuators["painter"].kind) == ("", "")
    assert str(CODE.parent) not in str(told.as_mapping())
    assert body_from_mapping(body.as_mapping(), "static.json") == body
    assert load_body("epuck").agent_view == load_body("epuck")


def fit(monkeypatch: pytest.MonkeyPatch, *fields: Field) -> dict[str, int]:
    """The fields that agents are told of, of a custom sensor with these."""
    monkeypatch.setattr(custom_code.Alone, "fields", fields)
    spec: Any = fitted(body_from(SHEET, "mine.toml"), "mine.toml").sensors["x"]
    return spec.fields


@pytest.mark.parametrize(
    ("of", "said"),
    [
        ({"step": nan}, "expected step as a finite number from 0; got nan"),
        ({"step": -0.1}, "expected step as a finite number from 0; got -0.1"),
        ({"step": "0.1"}, "expected step as a finite number from 0; got '0.1'"),
        ({"step": True}, "expected step as a finite number from 0; got True"),
        ({"low": 1.0, "high": 0.5}, "expected low not above high; got 1.0 and 0.5"),
        ({"low": nan}, "expected low as a number; got nan"),
        ({"high": None}, "expected high as a number; got None"),
        ({"blank": None}, "expected blank as a number; got None"),
        ({"noise": 0.1}, "expected noise as a Noise; got 0.1"),
        ({"noise": Noise(kind=UNKNOWN)}, "expected noise of the kind uniform or normal; got 'gaussian'"),
        ({"noise": Noise(size=-1.0)}, "expected noise.size as a finite number from 0; got -1.0"),
        ({"noise": Noise(relative=inf)}, "expected noise.relative as a finite number from 0; got inf"),
        ({"width": -1}, "expected a width from 0 to 10000; got -1"),
        ({"width": 1.5}, "expected a width from 0 to 10000; got 1.5"),
        ({"span": (1.0, 0.0)}, "expected span as two finite numbers that do not fall; got (1.0, 0.0)"),
        ({"span": (0.0, inf)}, "expected span as two finite numbers that do not fall; got (0.0, inf)"),
        ({"unit": 1}, "expected unit as a text; got 1"),
        ({"help": None}, "expected help as a text; got None"),
        ({"per": 2.0}, "expected per as a text; got 2.0"),
        ({"span": 3}, "expected span as two finite numbers that do not fall; got 3"),
    ],
)
def test_a_field_that_cannot_be_is_refused(monkeypatch: pytest.MonkeyPatch, of: dict[str, Any], said: str) -> None:
    with pytest.raises(BadInput, match=f"^mine.toml: sensors.x.kind: the field b of Alone: {re.escape(said)}$"):
        fit(monkeypatch, Field("a"), Field("b", **of))


@pytest.mark.parametrize("name", ["", "a b", 3])
def test_a_field_has_a_name(monkeypatch: pytest.MonkeyPatch, name: Any) -> None:
    with pytest.raises(BadInput, match="expected fields with names of their own, of letters, digits and _; got a, "):
        fit(monkeypatch, Field("a"), Field(name))


def test_fields_at_their_limits_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    noise: Any = Noise("uniform", 0, np.float32(0.5))
    told = fit(monkeypatch, Field("a", 2, noise, 0, -inf, 1, blank=-1), Field("b", low=1.0, high=1.0, span=(0, 0)))
    assert told == {"a": 2, "b": 0}
