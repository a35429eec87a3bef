"""What a key may hold, in words, from its JSON schema."""

from typing import Any

from reference.markdown import code, number, toml

Variant = tuple[str, str, str]  # the key that tells, its value, the definition's name


def without_null(value: dict[str, Any]) -> dict[str, Any]:
    """The schema of what may stand there if the key is given at all."""
    given = [item for item in value.get("anyOf", []) if item.get("type") != "null"]
    rest = {key: item for key, item in value.items() if key != "anyOf"}
    return {**rest, **given[0]} if len(given) == 1 else {**rest, "anyOf": given} if given else value


def variants_of(value: dict[str, Any]) -> list[Variant]:
    """The tables that a key may hold, alone, in a list or by name."""
    if "$ref" in value:
        return [("", "", _name(value["$ref"]))]
    if "discriminator" in value:
        tag = value["discriminator"]["propertyName"]
        return [(tag, name, _name(ref)) for name, ref in value["discriminator"]["mapping"].items()]
    if "anyOf" in value or "oneOf" in value:
        return [variant for item in value.get("anyOf", value.get("oneOf", [])) for variant in variants_of(item)]
    for key in ("items", "additionalProperties"):
        if isinstance(value.get(key), dict):
            return variants_of(value[key])
    by_pattern: dict[str, Any] = value.get("patternProperties", {})
    return [variant for item in by_pattern.values() for variant in variants_of(item)]


def words_of(value: dict[str, Any]) -> str:
    """Kind, unit and bounds, such as "number in m, above 0"; choices as code."""
    if "anyOf" in value:
        return " or ".join(words_of(item) for item in value["anyOf"])
    if variants_of(value):
        return "tables" if value.get("type") == "array" else "table"
    if "const" in value or "enum" in value:
        return " or ".join(code(toml(choice)) for choice in value.get("enum", [value.get("const")]))
    kind: str = value.get("type", "any")
    if kind == "array":
        return _list(value)
    unit = f" in {value['unit']}" if "unit" in value else ""
    name = {"integer": "whole number", "boolean": "true or false", "string": "text", "object": "table"}.get(kind, kind)
    return ", ".join([name + unit, *_bounds(value)])


def _list(value: dict[str, Any]) -> str:
    if "prefixItems" not in value:
        kind, *rest = words_of(value.get("items", {})).split(" ", maxsplit=1)
        return " ".join([f"list of {kind}s", *rest])
    items = [words_of(item) for item in value["prefixItems"]]
    return "list of " + "; ".join(f"{items.count(item)} x {item}" for item in dict.fromkeys(items))


def _bounds(value: dict[str, Any]) -> list[str]:
    low, high = value.get("minimum"), value.get("maximum")
    found = [f"{number(low)} to {number(high)}"] if low is not None and high is not None else []
    if not found:
        found += [f"at least {number(low)}"] if low is not None else []
        found += [f"at most {number(high)}"] if high is not None else []
    above, below = value.get("exclusiveMinimum"), value.get("exclusiveMaximum")
    found = [f"above {number(above)}", *found] if above is not None else found
    return [*found, f"below {number(below)}"] if below is not None else found


def _name(ref: str) -> str:
    return ref.rsplit("/", maxsplit=1)[-1]
