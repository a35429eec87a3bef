"""Which values of a scenario are whole numbers, by their path: ranges over them are rounded."""

from collections.abc import Callable
from typing import Any, cast

from swarmwire.agent.agent import load_agent
from swarmwire.agent.parameters import parameters_of
from swarmwire.deploy.agents import agent_specs
from swarmwire.world.scenario.scenario import Scenario, mapping_of
from swarmwire.world.scenario.schema import Node, plain
from swarmwire.world.scenario_file import scenario_schema


def whole_numbers(scenario: Scenario) -> Callable[[str], bool]:
    """The function that tells of a path whether its value must be a whole number; of unknown paths it says no."""
    schema, mapping = scenario_schema(), mapping_of(scenario)

    def is_whole(path: str) -> bool:
        keys = path.split(".")
        if len(keys) == 4 and keys[0] == "robots" and keys[2] == "params":
            return _is_whole_parameter(scenario, keys[1], keys[3])
        return _node_at(keys, mapping, schema).get("type") == "integer"

    return is_whole


def _is_whole_parameter(scenario: Scenario, group: str, name: str) -> bool:
    """Of an agent's parameter, which its class declares."""
    if group not in scenario.robots:
        return False
    found = parameters_of(load_agent(agent_specs(scenario)[group])).get(name)
    return found is not None and found.type is int


def _node_at(keys: list[str], mapping: object, schema: Node) -> Node:
    """The schema's node at a path; where one of several tables may stand, of that which the scenario's mapping has."""
    node, at = schema, mapping
    for key in keys:
        node = _chosen(plain(node, schema), at, schema)
        if key.isdecimal():
            places: list[Node] = node.get("prefixItems", [])
            node = places[int(key)] if int(key) < len(places) else node.get("items") or Node()
        else:
            named: Node = node.get("properties", {})
            patterned: Node = node.get("patternProperties", {})
            node = named.get(key) or next(iter(patterned.values()), Node())
        at = _item(at, key)
    return plain(node, schema)


def _chosen(node: Node, at: object, schema: Node) -> Node:
    if "discriminator" not in node or not isinstance(at, dict):
        return node
    tables: dict[str, str] = node["discriminator"]["mapping"]
    tag = cast("dict[str, Any]", at).get(node["discriminator"]["propertyName"])
    return plain({"$ref": tables[tag]}, schema) if tag in tables else node


def _item(at: object, key: str) -> object:
    if isinstance(at, dict):
        return cast("dict[str, object]", at).get(key)
    if isinstance(at, list) and key.isdecimal():
        items = cast("list[object]", at)
        return items[int(key)] if int(key) < len(items) else None
    return None
