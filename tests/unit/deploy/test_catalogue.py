"""What `list` and `describe` know: every entry of every registry, found by its name and printed with all it takes."""

import json
import re
from dataclasses import MISSING, fields, is_dataclass, replace
from functools import cache
from io import StringIO
from typing import Any, get_args, get_type_hints

import pytest
from rich.console import Console

from swarmwire.agent import behaviours
from swarmwire.agent.parameters import REQUIRED, parameters_of
from swarmwire.agent.step_context import TX_STATUS
from swarmwire.comms.base.config import bounds_of
from swarmwire.comms.radio.config.impairments import Measures
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.stages.chain import ORDER
from swarmwire.comms.robot.bodies.body import body_names, load_body
from swarmwire.comms.robot.bodies.drives import DRIVES, Leds
from swarmwire.comms.robot.bodies.ros2_names import Ros2Names
from swarmwire.comms.robot.packets import FATE_NAMES
from swarmwire.comms.robot.sensors import SENSOR_SPECS
from swarmwire.deploy.cli.catalogue import kinds
from swarmwire.deploy.cli.catalogue.kinds import KINDS, find, print_entry, print_list
from swarmwire.deploy.cli.catalogue.schema import CatalogueEntry, unit_of
from swarmwire.metrics.measures.registry import METRICS
from swarmwire.world.events import ACTIONS
from swarmwire.world.scenario.scenario import PhysicsTable
from swarmwire.world.scenario.schema import written_form
from swarmwire.world.scenario_file import scenario_schema
from tests.support.custom_code import install
from tests.support.deploy.runs import LOSSY, ROOT, called
from tests.support.refusals import refused_input

EVENTS = {next(field.default for field in fields(kind) if field.name == "do"): kind for kind in ACTIONS}
OF_EACH_KIND = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
HELD = {
    "bodies": [*body_names()],
    "sensors": [*SENSOR_SPECS, *(f"radio.{field.name}" for field in fields(Measures)), TX_STATUS],
    "behaviours": behaviours.__all__,
    "drives": [*DRIVES],
    "engines": [*get_args(PhysicsTable.model_fields["engine"].annotation)],
    "events": [*EVENTS],
    "metrics": [*METRICS],
    "stages": [kind.name for kind in ORDER],
    "fates": [*FATE_NAMES],
}
REGISTRIES = {"drive": DRIVES, "sensor": SENSOR_SPECS, "event": EVENTS, "metric": METRICS}
CLASSES: dict[str, Any] = {
    "radio": Radio,
    "leds": Leds,
    "body-key:ros2": Ros2Names,
    **{f"{kind}:{name}": held for kind, registry in REGISTRIES.items() for name, held in registry.items()},
}
OWN = '''from swarmwire.agent import Agent, parameter

class Mine(Agent):
    """Turns on the spot.

    For ever.
    """

    needs = ("compass",)
    turn_radps: float = parameter(0.5, help="how fast: # in all", at_least=0.0)
    name: str

    def step(self, robot):
        robot.drive(0.0, self.turn_radps)
'''


def printed(entry: CatalogueEntry, width: int | None = None) -> str:
    """A description, piped or in a terminal of this width."""
    out = StringIO()
    print_entry(entry, Console(file=out, width=width, force_terminal=width is not None, color_system=None))
    return out.getvalue()


def lines_of(kind: Any) -> list[tuple[str, ...]]:
    """Name, help, unit, default and choices of each parameter of a dataclass."""
    kind = written_form(kind)
    hints = get_type_hints(kind)
    wanted: list[tuple[str, ...]] = []
    for field in fields(kind):
        limits = bounds_of(field)
        inner = [hint for hint in (hints[field.name], *get_args(hints[field.name])) if is_dataclass(hint)]
        default = "" if field.default in (MISSING, None) or inner else json.dumps(field.default)
        wanted.append((field.name, limits.help, limits.unit, default, *limits.choices))
        wanted += [(f"{field.name}.{name}", *cells) for hint in inner for name, *cells in lines_of(hint)]
    return wanted


def assert_tells(text: str, wanted: list[tuple[str, ...]]) -> None:
    """Every parameter has a line that starts with its name and holds all that is wanted of it."""
    for name, *parts in wanted:
        lines = [line for line in text.splitlines() if line.split()[:1] == [name]]
        assert any(all(part in line for part in parts) for line in lines), (name, parts, lines)


@OF_EACH_KIND
def test_list_has_a_plain_line_for_each_entry_of_a_registry(kind):
    names = [entry.name for entry in kind.entries()]
    assert names == HELD.get(kind.name, names)
    assert len({name.lower() for name in names}) == len(names) > 0
    print_list(kind, Console(file=(out := StringIO())))
    heading, *lines = out.getvalue().splitlines()
    assert heading.startswith(kind.singular)
    assert [line.split("  ")[0] for line in lines] == names
    assert all(line == line.rstrip() and line.isprintable() for line in lines)


@pytest.fixture
def kinds_once(monkeypatch):
    """Entries are made once, not for each name that is looked up."""
    monkeypatch.setattr(kinds, "KINDS", tuple(replace(kind, entries=cache(kind.entries)) for kind in KINDS))


@OF_EACH_KIND
@pytest.mark.usefixtures("kinds_once")
def test_entry_is_found_by_name_and_printed_with_every_parameter(kind):
    entries = kind.entries()
    for entry in entries[:: 1 + len(entries) // 60]:  # of hundreds of keys, some
        by_name = [find(f"{prefix}:{entry.name}") for prefix in (kind.singular, kind.name)]
        assert {repr(same) for same in by_name} == {repr(entry)}  # not ==: a blank reading is NaN, which equals nothing
        assert entry.help.strip()
        assert "\n" not in entry.help
        text, narrow = printed(entry), printed(entry, width=80)
        assert entry.help in text
        assert max(map(len, narrow.splitlines())) <= 80
        for parameter in (parameter for table in entry.tables for parameter in table.parameters):
            value = "" if parameter.value is None else json.dumps(parameter.value, ensure_ascii=False)
            value = "required" if parameter.required else value
            assert_tells(text, [(parameter.name, value, parameter.unit, parameter.help)])
            assert f"\n{parameter.name} " in narrow


@pytest.mark.parametrize("name", CLASSES)
def test_entry_of_a_class_describes_each_of_its_fields(name):
    assert_tells(printed(find(name)), lines_of(CLASSES[name]))


@pytest.mark.parametrize("name", behaviours.__all__)
@pytest.mark.usefixtures("kinds_once")
def test_behaviour_entry_shows_needs_and_parameters(name):
    kind, text = getattr(behaviours, name), printed(find(name))
    assert ", ".join(kind.needs) in text
    for parameter in parameters_of(kind).values():
        default = "required" if parameter.default is REQUIRED else json.dumps(parameter.default)
        assert_tells(text, [(parameter.name, default, unit_of(parameter.name))])
    assert find(f"swarmwire.agent.behaviours:{name}") == find(name)


@pytest.mark.parametrize("name", body_names())
def test_body_entry_shows_the_figures_of_its_sheet(name):
    body, text = load_body(name), printed(find(f"body:{name}"))
    assert all(part in text for part in (body.source, f"{body.radius_m}", f"{body.max_linear_mps:.4g} m/s"))
    sheets = {"drive": body.drive, **{f"sensor: {sensor}": body.sensors[sensor] for sensor in body.sensors}}
    for title, sheet in sheets.items():
        plain = [field for field in fields(sheet) if not is_dataclass(getattr(sheet, field.name))]
        figures = [(field.name, bounds_of(field).unit, json.dumps(getattr(sheet, field.name))) for field in plain]
        assert_tells(text[text.index(f"\n{title}\n") :], figures)


def test_metrics_and_stages_tell_what_their_code_says():
    for name, metric in METRICS.items():
        facts = dict(find(f"metric:{name}").facts)
        assert (facts["unit"], facts["kind"].startswith(metric.kind)) == (metric.unit or "none", True)
        assert facts["bounds"]
    for kind in ORDER:
        entry = find(f"stage:{kind.name}")
        names = {parameter.name for table in entry.tables for parameter in table.parameters}
        assert {f"radio.{key}" for key in kind.keys} <= names
        assert bool(names) == bool(kind.keys)


def test_schema_keys_of_a_scenario_can_all_be_described():
    entries = [entry for kind in KINDS if kind.name in ("keys", "radio") for entry in kind.entries()]
    for table in scenario_schema()["$defs"].values():
        for name, node in table["properties"].items():
            text = " ".join(node.get("description", "").split("\n\n")[0].removesuffix(".").split())
            assert any(entry.name.split(".")[-1] == name and text in entry.help for entry in entries), name


@pytest.mark.parametrize(
    ("name", "path"),
    [
        ("seed", "seed, before the first table"),
        ("radio", "the table [radio]"),
        ("radio.measures.range.noise_m", "noise_m in [radio.measures.range]"),
        ("robots.*.place.radius_m", "radius_m in [robots.GROUP.place]"),
        ("arena.lights", "the tables [[arena.lights]]"),
        ("events.*.robots.share", "share in [events.robots]"),
    ],
)
def test_key_entry_shows_its_place_in_a_scenario_file(name, path):
    assert dict(find(name).facts)["in a scenario"] == path


@pytest.mark.parametrize(
    ("query", "name"),
    [
        ("ORDER", "order"),
        ("loss", "radio.loss"),
        ("robots.flock.count", "robots.*.count"),
        ("arena.obstacles.0.shape", "arena.obstacles.*.shape"),
        ("robots.flock", "robots.*"),
        ("events:kill", "kill"),
    ],
)
def test_entry_is_found_by_a_short_name_or_the_users_group_name(query, name):
    assert find(query).name == name


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("flokking", "Flocking"),
        ("radio.los", "radio.loss"),
        ("metric:kill", ""),
        ("xyzzy", ""),
        ("blackout", "event:blackout, fate:blackout"),
        ("size_m", "arena.size_m, arena.obstacles.*.within.size_m"),
        ("fates", "swarmwire list fates"),
        ("absent.toml", ""),
        ("absent.py:Mine", ""),
        ("absent.py", "absent.py:Class"),
        (str(LOSSY), "swarmwire check"),
        ("swarmwire.agent:Robot", "Agent or VectorAgent"),
    ],
)
def test_unknown_or_ambiguous_name_is_refused_with_what_to_try(query, expected):
    with refused_input(query, match=re.escape(expected)):
        find(query)


def test_bodies_and_agents_of_a_user_are_described_as_shipped_ones(tmp_path, monkeypatch):
    (tmp_path / "mine.toml").write_text('like = "epuck"\nmass_kg = 0.7\n[sensors.proximity]\nnoise = 0.25\n')
    (tmp_path / "my_agent.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    mine, epuck = (
        [row for table in find(name).tables for row in table.parameters] for name in ("mine.toml", "body:epuck")
    )
    changed = [(now.name, now.value) for now, was in zip(mine, epuck, strict=True) if repr(now) != repr(was)]
    assert changed == [("mass_kg", 0.7), ("noise", 0.25)]
    text = printed(find("my_agent.py:Mine"))
    assert "Turns on the spot.\n\nFor ever." in text
    needs = [("turn_radps", "rad/s", "0.5", "how fast: # in all"), ("name", "required"), ("needs", "compass")]
    assert_tells(text, needs)
    text = printed(find(str(ROOT / "examples" / "gas" / "sniffer.toml")))
    gas, sealer = (text[text.index(f"\n{title}") :] for title in ("sensor: gas", "actuator: sealer"))
    assert_tells(gas, [("kind", "gas.py:Gas"), ("rate_hz", "5.0"), ("reach_m", "m", "1.0")])
    assert_tells(sealer, [("kind", "gas.py:Sealer"), ("arm_m", "m", "0.3")])


def test_metric_of_a_user_is_described_with_its_form_in_a_scenario_and_what_is_neither_is_refused(monkeypatch):
    monkeypatch.chdir(ROOT / "examples" / "gas")
    assert_tells(printed(find("sealing.py:Sealing")), [("measured", '["sealing.py:Sealing"]'), ("bounds", "0 to 1")])
    with refused_input("gas.py:Gas", match="no Agent or VectorAgent"):
        find("gas.py:Gas")


def test_metrics_of_packages_are_listed_and_described_also_if_they_do_not_import(tmp_path, monkeypatch, capsys):
    install(tmp_path, "sky_metrics", {"east": "East"})
    install(tmp_path, "fog_metrics", {"west": "East"}, code="raise ValueError('fog')")
    monkeypatch.syspath_prepend(tmp_path)
    kinds = called(monkeypatch, capsys, "list")[1]
    assert all(f"{kind.name} " in kinds for kind in KINDS)
    lines = called(monkeypatch, capsys, "list", "metrics")[1].splitlines()
    lines_by_name = {line.split()[0]: line for line in lines}
    assert "plug-in" in lines_by_name["east"]
    assert "ValueError: fog" in lines_by_name["west"]
    text = called(monkeypatch, capsys, "describe", "east")[1]
    assert all(part in text for part in ('metric = "east"', "from_m = 0.0", "sky_metrics:East", "at least -9"))
    assert called(monkeypatch, capsys, "describe", "west")[0] == 0
