"""What a registry holds is described with its help, units, defaults and source."""

import json
from dataclasses import MISSING, fields, is_dataclass
from io import StringIO
from typing import get_args, get_type_hints

import pytest
from rich.console import Console

from swarmwire.agent import behaviours
from swarmwire.agent.declared import REQUIRED, parameters_of
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.stages.chain import ORDER
from swarmwire.comms.bodies.body import body_names, load_body
from swarmwire.comms.bodies.drives import DRIVES
from swarmwire.comms.bodies.leds import Leds
from swarmwire.comms.events.registry import ACTIONS
from swarmwire.comms.parameters import limits_of
from swarmwire.comms.sheets import SHEETS
from swarmwire.deploy.catalogue.entry import Entry
from swarmwire.deploy.catalogue.find import find
from swarmwire.deploy.catalogue.kinds import KINDS
from swarmwire.deploy.catalogue.text import print_entry
from swarmwire.deploy.catalogue.units import unit_of
from swarmwire.metrics.registry import METRICS
from swarmwire.world.scenario.scenario_file import scenario_schema
from swarmwire.world.scenario.schema import written_form
from tests.docs.pages import ROOT
from tests.support.deploy.commands import called

ACTION_OF = {next(of.default for of in fields(kind) if of.name == "do"): kind for kind in ACTIONS}
DEFINITIONS = scenario_schema()["$defs"]
OWN = '''"""Mine."""
from swarmwire.agent import Agent

class Mine(Agent):
    """Turns on the spot.

    For ever.
    """

    needs = ("compass",)
    turn_radps: float = 0.5  # how fast: # in all
    name: str

    def step(self, robot):
        robot.drive(0.0, self.turn_radps)
'''


def told(name: str) -> str:
    """What `describe` prints where it is piped."""
    return printed(find(name))


def printed(entry: Entry, width: int | None = None) -> str:
    """A description, piped or in a terminal of this width."""
    out = StringIO()
    print_entry(entry, Console(file=out, width=width, force_terminal=width is not None, color_system=None))
    return out.getvalue()


def lines_of(kind) -> list[tuple[str, ...]]:
    """By line of a description: what it must hold of each parameter of a dataclass."""
    wanted = []
    kind = written_form(kind)
    hints = get_type_hints(kind)
    for of in fields(kind):
        limits, inner = (
            limits_of(of),
            [hint for hint in (hints[of.name], *get_args(hints[of.name])) if is_dataclass(hint)],
        )
        default = "" if of.default in (MISSING, None) or inner else json.dumps(of.default)
        wanted.append((of.name, limits.help, limits.unit, default, *limits.choices))
        wanted += [(f"{of.name}.{name}", *rest) for hint in inner for name, *rest in lines_of(hint)]
    return wanted


def assert_tells(text: str, wanted: list[tuple[str, ...]]) -> None:
    """Every parameter has a line that starts with its name and holds all that is wanted of it."""
    for name, *parts in wanted:
        lines = [line for line in text.splitlines() if line.split()[:1] == [name]]
        assert any(all(part in line for part in parts) for line in lines), (name, parts, lines)


@pytest.mark.parametrize("module", ORDER, ids=lambda module: module.__name__.rpartition(".")[2])
def test_a_stage_tells_the_keys_that_it_goes_by(module):
    entry = find(f"stage:{module.__name__.rpartition('.')[2]}")
    told = {parameter.name for table in entry.tables for parameter in table.parameters}
    assert {f"radio.{key}" for key in module.KEYS} <= told
    assert bool(told) == bool(module.KEYS)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_every_thing_has_its_own_name_and_a_line_of_help(kind):
    entries = kind.entries()
    assert len({entry.name.lower() for entry in entries}) == len(entries)
    for entry in entries:
        assert entry.kind == kind.one
        assert entry.help
        assert "\n" not in entry.help
        assert entry.help in printed(entry)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_80_columns_hold_every_description_and_cut_no_name(kind):
    for entry in kind.entries():
        text = printed(entry, width=80)
        assert max(len(line) for line in text.splitlines()) <= 80
        for table in entry.tables:
            for parameter in table.parameters:
                assert f"\n{parameter.name} " in text


@pytest.mark.parametrize("name", body_names())
def test_a_body_tells_its_figures_units_senses_and_source(name):
    body, text = load_body(name), told(f"body:{name}")
    assert body.source in text
    for title, sheet in [("drive", body.drive), *((f"sense: {sense}", body.senses[sense]) for sense in body.senses)]:
        section = text[text.index(f"\n{title}\n") :]
        for of in fields(sheet):
            value = getattr(sheet, of.name)
            figure = "" if is_dataclass(value) else json.dumps(value)
            assert_tells(section, [(of.name, limits_of(of).unit, figure, limits_of(of).help)])
    if body.proximity:
        assert_tells(text, [("response.reach_m", f"{body.proximity.response.reach_m}")])
    assert f"{body.radius_m}" in text
    assert f"{body.max_linear_mps:.4g} m/s" in text


def test_a_body_of_ones_own_tells_what_one_that_comes_along_does(tmp_path):
    sheet = tmp_path / "mine.toml"
    sheet.write_text('like = "epuck"\nmass_kg = 0.7\n[senses.proximity]\nnoise = 0.25\n')
    mine, epuck = find(str(sheet)), find("body:epuck")
    changed = [
        (now.name, now.value)
        for table, before in zip(mine.tables, epuck.tables, strict=True)
        for now, was in zip(table.parameters, before.parameters, strict=True)
        if now != was
    ]
    assert changed == [("mass_kg", 0.7), ("noise", 0.25)]
    assert mine.facts[1:] == epuck.facts[1:]


def test_a_body_of_ones_own_tells_its_own_senses_and_actuators():
    text = told(str(ROOT / "examples" / "gas" / "sniffer.toml"))
    titles = "sense: gas, which reads concentration", "actuator: sealer"
    gas, sealer = (text[text.index(f"\n{title}\n") :] for title in titles)
    assert_tells(gas, [("kind", "gas.py:Gas"), ("rate_hz", "5.0"), ("reach_m", "m", "1.0", "fallen to 37 %")])
    assert_tells(sealer, [("kind", "gas.py:Sealer"), ("arm_m", "m", "0.3", "how far it reaches")])


@pytest.mark.parametrize("name", DRIVES)
def test_a_drive_tells_the_keys_of_its_table(name):
    assert_tells(told(name), lines_of(DRIVES[name]))


def test_the_leds_of_a_sheet_tell_their_keys():
    assert_tells(told("leds"), lines_of(Leds))


@pytest.mark.parametrize("name", SHEETS)
def test_a_sense_tells_its_data_sheet_and_how_it_is_read(name):
    text = told(f"sense:{name}")
    assert_tells(text, lines_of(SHEETS[name]))
    assert f"robot.{name}: " in text
    assert f'needs = ("{name}", …)' in text


@pytest.mark.parametrize("name", behaviours.__all__)
def test_a_behaviour_tells_its_needs_and_each_parameter_with_unit_default_and_help(name):
    kind = getattr(behaviours, name)
    text, entry = told(name), find(name)
    assert ", ".join(kind.needs) in text
    assert f'agent = "swarmwire.agent.behaviours:{name}"' in text
    of = {parameter.name: parameter for table in entry.tables for parameter in table.parameters}
    for parameter in parameters_of(kind).values():
        assert of[parameter.name].help, parameter.name
        default = "required" if parameter.default is REQUIRED else json.dumps(parameter.default)
        assert_tells(text, [(parameter.name, default, unit_of(parameter.name), of[parameter.name].help)])
    assert find(f"swarmwire.agent.behaviours:{name}") == entry


@pytest.mark.parametrize("name", ACTION_OF)
def test_an_event_tells_its_keys(name):
    text = told(f"event:{name}")
    assert_tells(text, lines_of(ACTION_OF[name]))
    assert "required" in next(line for line in text.splitlines() if line.startswith("at_s"))


@pytest.mark.parametrize("name", METRICS)
def test_a_metric_tells_formula_unit_bounds_kind_and_parameters(name):
    kind, text = METRICS[name], told(f"metric:{name}")
    facts = dict(find(f"metric:{name}").facts)
    assert facts["unit"] == (kind.unit or "none")
    assert facts["kind"].startswith(kind.kind)
    assert facts["bounds"]
    assert_tells(text, lines_of(kind))
    assert " ".join((kind.__doc__ or "").split("\n\n")[0].split()) in text


def test_a_formulas_source_is_told_with_it():
    assert "Source: T. Vicsek et al." in told("order")


def test_the_radio_tells_all_its_keys():
    assert_tells(told("radio"), lines_of(Radio))


@pytest.mark.parametrize("table", DEFINITIONS)
def test_every_key_of_a_scenarios_schema_can_be_described(table):
    entries = [entry for kind in KINDS if kind.name in ("keys", "radio") for entry in kind.entries()]
    for name, node in DEFINITIONS[table]["properties"].items():
        described = node.get("description", "").split("\n\n")[0].removesuffix(".")
        text = " ".join(described.split())
        assert any(entry.name.split(".")[-1] == name and text in entry.help for entry in entries), name


def test_a_key_tells_unit_default_and_bounds():
    assert "s     0.0      delay of every packet beyond its airtime; a number of at least 0 and at most 3600" in told(
        "radio.latency_s"
    )
    assert "required  How many robots; a whole number of at least 1 and at most 1000000" in told("robots.*.count")


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("seed", "seed, before the first table"),
        ("radio", "the table [radio]"),
        ("radio.gives.range.noise_m", "noise_m in [radio.gives.range]"),
        ("robots.*", "the table [robots.GROUP]"),
        ("robots.*.place.radius_m", "radius_m in [robots.GROUP.place]"),
        ("arena.lights", "the tables [[arena.lights]]"),
        ("events.*.at_s", "at_s in [[events]]"),
        ("events.*.robots.share", "share in [events.robots]"),
    ],
)
def test_a_key_tells_where_the_file_has_it(name, place):
    assert dict(find(name).facts)["in a scenario"] == place


def test_an_agent_of_ones_own_is_described_by_its_docstring_and_comments(tmp_path, monkeypatch):
    (tmp_path / "my_agent.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    text = told("my_agent.py:Mine")
    assert "Turns on the spot.\n\nFor ever." in text
    assert_tells(
        text, [("turn_radps", "rad/s", "0.5", "how fast: # in all"), ("name", "required"), ("needs", "compass")]
    )
    assert "one robot (Agent)" in text


def test_the_describe_command_gives_json_to_programs(monkeypatch, capsys):
    found = json.loads(called(monkeypatch, capsys, "describe", "radio.loss", "--json")[1])
    (loss,) = found["tables"][0]["parameters"]
    assert (found["kind"], loss["value"], loss["required"]) == ("radio", 0.0, False)
