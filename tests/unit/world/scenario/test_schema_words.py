"""What a key expects is said in words, references followed and "or null" left out."""

import pytest

from swarmwire.world.scenario.schema_words import Node, plain, words

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
