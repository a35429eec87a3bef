"""Every name that a registry holds is listed, in its order."""

import json
from dataclasses import fields
from io import StringIO
from typing import get_args

import pytest
from rich.console import Console

from swarmwire.agent import behaviours
from swarmwire.agent.turn import OUTCOMES
from swarmwire.comms.air.parameters.gives import Gives
from swarmwire.comms.air.stages.chain import ORDER
from swarmwire.comms.bodies.body import body_names
from swarmwire.comms.bodies.drives import DRIVES
from swarmwire.comms.events.registry import ACTIONS
from swarmwire.comms.fates import FATE_NAMES
from swarmwire.comms.sheets import SHEETS
from swarmwire.deploy.catalogue.kinds import KINDS
from swarmwire.deploy.catalogue.text import print_list
from swarmwire.metrics.registry import METRICS
from swarmwire.world.scenario.scenario import PhysicsTable
from tests.support.deploy.commands import called
from tests.support.metrics.packages import install

EVENTS = [next(of.default for of in fields(kind) if of.name == "do") for kind in ACTIONS]


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("bodies", body_names()),
        ("senses", [*SHEETS, *(f"radio.{of.name}" for of in fields(Gives)), OUTCOMES]),
        ("behaviours", behaviours.__all__),
        ("drives", list(DRIVES)),
        ("sheets", ["name", "source", "radius_m", "height_m", "mass_kg", "altitude_m", "contacts", "leds"]),
        ("engines", list(get_args(PhysicsTable.model_fields["engine"].annotation))),
        ("events", EVENTS),
        ("metrics", list(METRICS)),
        ("stages", [module.__name__.rpartition(".")[2] for module in ORDER]),
        ("fates", list(FATE_NAMES)),
    ],
)
def test_a_kind_is_what_its_registry_holds(kind, names):
    entries = next(of for of in KINDS if of.name == kind).entries()
    assert [entry.name for entry in entries] == names


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_list_is_a_plain_line_for_each_thing_where_it_is_piped(kind):
    out = StringIO()
    print_list(kind, Console(file=out))
    heading, *lines = out.getvalue().splitlines()
    assert heading.startswith(kind.one)
    assert [line.split("  ")[0] for line in lines] == [entry.name for entry in kind.entries()]
    assert all(line == line.rstrip() and line.isprintable() for line in lines)


def test_the_list_command_names_kinds_and_things(monkeypatch, capsys):
    code, out, errors = called(monkeypatch, capsys, "list")
    assert (code, errors) == (0, "")
    for kind in KINDS:
        assert f"{kind.name} " in out
    [line] = [of for of in called(monkeypatch, capsys, "list", "metrics")[1].splitlines() if of.startswith("min_gap ")]
    assert line.split()[:3] == ["min_gap", "standard", "smallest"]
    assert list(json.loads(called(monkeypatch, capsys, "list", "--json")[1])) == [kind.name for kind in KINDS]


def test_a_metric_that_a_package_brings_is_listed_and_described_also_if_it_does_not_import(
    tmp_path, monkeypatch, capsys
):
    install(tmp_path, "sky_metrics", {"east": "East"})
    install(tmp_path, "fog_metrics", {"west": "East"}, code="raise ValueError('fog')")
    monkeypatch.syspath_prepend(tmp_path)
    lines = called(monkeypatch, capsys, "list", "metrics")[1].splitlines()
    told = {line.split()[0]: " ".join(line.split()[1:]) for line in lines}
    assert told["east"] == "plug-in mean x of the robots alive, in m"
    assert told["west"] == "plug-in cannot be measured: fog_metrics does not import: ValueError: fog"
    _, text, _ = called(monkeypatch, capsys, "describe", "east")
    assert 'metrics = ["east"], or [stop] names it' in text
    assert 'metrics = [{ metric = "east", from_m = 0.0 }]' in text
    assert "sky_metrics, as sky_metrics:East" in text
    assert "at least -9 and at most 9" in text
    assert called(monkeypatch, capsys, "describe", "west")[0] == 0


def test_a_kind_that_there_is_not_gets_one_line_and_exit_code_2(monkeypatch, capsys):
    code, out, errors = called(monkeypatch, capsys, "list", "nothing")
    assert (code, out) == (2, "")
    assert errors.startswith("error: nothing: ")
    assert errors.count("\n") == 1


@pytest.mark.parametrize("name", ["list", "describe", "new"])
def test_the_help_of_a_command_shows_how_it_is_called(monkeypatch, capsys, name):
    code, out, _ = called(monkeypatch, capsys, name, "--help")
    assert code == 0
    assert "For example" in out
    assert f" swarmwire {name} " in out
