"""A scenario's body is one that comes with swarmwire, or a sheet beside the scenario."""

from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.errors import BadInput
from swarmwire.world.placement.maps import beside
from swarmwire.world.scenario.bodies import bodies_of, custom_code_of, read_body, sheet_path
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.sensors import loading


def test_a_name_has_no_file_and_a_sheet_lies_beside_the_scenario(tmp_path):
    scenario = str(tmp_path / "swarm.toml")
    assert sheet_path("epuck", scenario) is None
    assert sheet_path("mine.toml", scenario) == beside(scenario, "mine.toml") == tmp_path / "mine.toml"
    assert sheet_path("/else/mine.toml", scenario) == beside(scenario, "/else/mine.toml") == Path("/else/mine.toml")


def test_a_sheet_may_start_from_a_body_that_comes_with_swarmwire(tmp_path):
    (tmp_path / "mine.toml").write_text('like = "epuck"\nname = "mine"\nmass_kg = 1.0\n')
    body = read_body(tmp_path / "mine.toml", "swarm.toml", "robots.flock.body")
    assert (body.name, body.mass_kg, body.drive) == ("mine", 1.0, load_body("epuck").drive)


def test_a_class_that_bodies_name_is_listed_once(tmp_path):
    kind = "tests.support.world.custom_code:Alone"
    (tmp_path / "mine.toml").write_text(f'like = "epuck"\nsensors.x.kind = "{kind}"\nsensors.y.kind = "{kind}"\n')
    body = read_body(tmp_path / "mine.toml", "swarm.toml", "robots.flock.body")
    assert custom_code_of([load_body("epuck"), body, body]) == (kind,)


@pytest.mark.parametrize(
    ("spec", "said"),
    [(None, "swarm.toml: robots.flock.body: expected a readable file"), ("mass_kg =", "mine.toml: expected TOML")],
)
def test_a_sheet_that_cannot_be_read_is_named_by_whoever_names_it(tmp_path, spec, said):
    if spec is not None:
        (tmp_path / "mine.toml").write_text(spec)
    with pytest.raises(BadInput) as caught:
        read_body(tmp_path / "mine.toml", "swarm.toml", "robots.flock.body")
    assert said in str(caught.value)


def bodies(tmp_path: Path, body: str, spec: dict[str, object]):
    """The bodies of two groups, of which only the first has a `spec`."""
    group = {"body": body, "count": 1, "agent": "a:A"}
    robots = {"worn": {**group, "body_overrides": spec}, "new": group}
    arena = {"size_m": [2.0, 2.0]}
    mapping = {"format": 1, "name": "s", "duration_s": 1.0, "arena": arena, "robots": robots}
    where = str(tmp_path / "swarm.toml")
    return bodies_of(scenario_from(mapping, where), where)


@pytest.mark.parametrize("body", ["epuck", "mine.toml"])
def test_a_scenario_changes_a_body_for_one_group(tmp_path, body):
    (tmp_path / "mine.toml").write_text('like = "epuck"\nmass_kg = 1.0\n')
    found = bodies(tmp_path, body, {"sensors": {"proximity": {"drop_out": 0.5}}})
    worn, new = found["worn"], found["new"]
    assert new.proximity is not None
    assert worn.proximity == replace(new.proximity, drop_out=0.5)
    assert worn.name == f"{new.name} of worn"
    assert (worn.mass_kg, worn.drive, worn.compass) == (new.mass_kg, new.drive, new.compass)


@pytest.mark.parametrize(
    ("spec", "key"),
    [
        ({"sensors": {"proximity": {"drop_out": 2}}}, "robots.worn.body_overrides.sensors.proximity.drop_out"),
        ({"weight_kg": 1.0}, "robots.worn.body_overrides.weight_kg"),
        ({"sensors": {"x": {"kind": "tests.support.world.custom_code:Alone"}}}, "robots.worn.body_overrides"),
    ],
)
def test_what_a_scenario_may_not_change_is_named(tmp_path, spec, key):
    with pytest.raises(BadInput) as caught:
        bodies(tmp_path, "epuck", spec)
    assert (caught.value.where, caught.value.key) == (str(tmp_path / "swarm.toml"), key)


def test_a_scenario_changes_parameters_of_a_users_own_sense_that_an_entry_point_names(tmp_path, monkeypatch):
    point = EntryPoint("painted", "tests.support.world.custom_code:Paint", "swarmwire.sensors")
    monkeypatch.setattr(loading, "entry_points_of", lambda _: [point])
    (tmp_path / "mine.toml").write_text('like = "epuck"\nsensors.paint.kind = "painted"\n')
    worn = bodies(tmp_path, "mine.toml", {"sensors": {"paint": {"cells": 2}}})["worn"]
    assert custom_code_of([worn]) == ("tests.support.world.custom_code:Paint",)
    with pytest.raises(BadInput, match="at least 1") as caught:
        bodies(tmp_path, "mine.toml", {"sensors": {"paint": {"cells": 0}}})
    assert caught.value.key == "robots.worn.body_overrides.sensors.paint.cells"
    assert caught.value.where == str(tmp_path / "swarm.toml")
