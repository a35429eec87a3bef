"""Type hashes of the independent messages, from their fields by REP 2016 (RIHS01)."""

import json
from dataclasses import fields
from hashlib import sha256
from typing import Any, get_type_hints

from pycdr2 import IdlStruct, types

IDS = {bool: 15, str: 17}  # type_description_interfaces/msg/FieldType
NAMED_IDS = {"uint8": 3, "int16": 4, "int32": 6, "uint32": 7, "float32": 10, "float64": 11}
NESTED, OF_ARRAY, OF_SEQUENCE = 1, 48, 144  # of a sequence without a bound


def rihs01(kind: type[IdlStruct]) -> str:
    """The hash of this kind of message."""
    structs: dict[str, dict[str, Any]] = {}
    _describe(kind, structs)
    root = structs.pop(kind.__idl_typename__)
    description = {
        "type_description": root,
        "referenced_type_descriptions": [s for _, s in sorted(structs.items())],
    }
    return f"RIHS01_{sha256(json.dumps(description).encode()).hexdigest()}"


def _describe(kind: type[IdlStruct], structs: dict[str, dict[str, Any]]) -> None:
    hints = get_type_hints(kind, include_extras=True)
    structs[kind.__idl_typename__] = {
        "type_name": kind.__idl_typename__,
        "fields": [{"name": field.name, "type": _type(hints[field.name], structs)} for field in fields(kind)],
    }


def _type(hint: Any, structs: dict[str, dict[str, Any]], more: int = 0, capacity: int = 0) -> dict[str, Any]:
    for marker in getattr(hint, "__metadata__", ()):
        if isinstance(marker, types.array):
            return _type(marker.subtype, structs, OF_ARRAY, marker.length)
        if isinstance(marker, types.sequence):
            return _type(marker.subtype, structs, OF_SEQUENCE)
    nested = isinstance(hint, type) and issubclass(hint, IdlStruct)
    if nested:
        _describe(hint, structs)
    number = NESTED if nested else IDS[hint] if hint in IDS else NAMED_IDS[hint.__metadata__[0]]
    return {
        "type_id": more + number,
        "capacity": capacity,
        "string_capacity": 0,
        "nested_type_name": hint.__idl_typename__ if nested else "",
    }
