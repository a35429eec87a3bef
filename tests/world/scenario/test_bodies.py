"""A scenario's body is one that comes with swarmwire, or a sheet beside the scenario."""

from pathlib import Path

import pytest

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.errors import BadInput
from swarmwire.world.placement.grey_image import beside
from swarmwire.world.scenario.bodies import own_code_of, read_body, sheet_path


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
    kind = "tests.world.own_code:Alone"
    (tmp_path / "mine.toml").write_text(f'like = "epuck"\nsenses.x.kind = "{kind}"\nsenses.y.kind = "{kind}"\n')
    body = read_body(tmp_path / "mine.toml", "swarm.toml", "robots.flock.body")
    assert own_code_of([load_body("epuck"), body, body]) == (kind,)


@pytest.mark.parametrize(
    ("sheet", "said"),
    [(None, "swarm.toml: robots.flock.body: expected a readable file"), ("mass_kg =", "mine.toml: expected TOML")],
)
def test_a_sheet_that_cannot_be_read_is_named_by_whoever_names_it(tmp_path, sheet, said):
    if sheet is not None:
        (tmp_path / "mine.toml").write_text(sheet)
    with pytest.raises(BadInput) as caught:
        read_body(tmp_path / "mine.toml", "swarm.toml", "robots.flock.body")
    assert said in str(caught.value)
