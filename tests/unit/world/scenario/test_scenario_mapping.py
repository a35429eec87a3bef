"""A scenario as a mapping again, and its schema in words."""

import tomllib

import pytest

from swarmwire.world.scenario.scenario import mapping_of, same_content
from swarmwire.world.scenario.schema import Node, plain, words
from swarmwire.world.scenario_file import load_scenario, scenario_from
from tests.support.deploy.commands import LOSSY, ROOT

SCENARIOS = sorted((ROOT / "scenarios").glob("*.toml"))


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_what_was_read_comes_back_as_it_was_written(path):
    assert mapping_of(load_scenario(path)) == tomllib.loads(path.read_text())


def test_overrides_are_part_of_it():
    mapping = mapping_of(load_scenario(LOSSY, ["radio.loss=0.25", "run.on_runner_loss=dead"]))
    assert mapping["radio"]["loss"] == 0.25
    assert mapping["run"] == {"on_runner_loss": "dead"}


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_a_scenario_that_was_changed_in_python_says_what_it_is_now(path):
    changed = load_scenario(path).model_copy(update={"duration_s": 1.5})
    mapping = mapping_of(changed)
    assert mapping["duration_s"] == 1.5
    assert same_content(scenario_from(mapping, str(path)), changed)  # beside the pictures that it names


def test_the_mapping_is_the_callers_own():
    scenario = load_scenario(LOSSY)
    mapping_of(scenario)["robots"]["flock"]["count"] = 1
    assert mapping_of(scenario)["robots"]["flock"]["count"] == 20


SCHEMA: Node = {"$defs": {"Disc": {"type": "object", "properties": {"radius_m": {"type": "number"}}}}}


@pytest.mark.parametrize(
    ("node", "said"),
    [
        ({"type": "integer", "minimum": 1, "maximum": 1000}, "a whole number of at least 1 and at most 1000"),
        ({"type": "number", "exclusiveMinimum": 0, "unit": "s"}, "a number above 0 (s)"),
        ({"enum": ["walls", "open"]}, "one of walls, open"),
        ({"const": 1}, "1"),
        ({"type": "string", "minLength": 1}, "a text that is not empty"),
        ({"anyOf": [{"type": "boolean"}, {"type": "string"}]}, "true or false or a text"),
        ({"anyOf": [{"type": "boolean"}, {"type": "null"}]}, "true or false"),
        ({"type": "array", "prefixItems": [{"type": "number"}, {"type": "number"}]}, "a list of 2 numbers"),
        ({"$ref": "#/$defs/Disc"}, "a table"),
    ],
)
def test_a_key_is_told_in_words(node, said):
    assert words(node, SCHEMA) == said


def test_a_reference_that_may_be_null_leads_to_its_table():
    node = {"anyOf": [{"$ref": "#/$defs/Disc"}, {"type": "null"}], "default": None}
    assert plain(node, SCHEMA) == SCHEMA["$defs"]["Disc"]
