"""A campaign as a TOML file: which scenario, what varies, which seeds."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.config import check_format, did_you_mean, read_toml
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.arguments import SEEDS, seed_list
from swarmwire.deploy.campaign.design import GRID
from swarmwire.deploy.campaign.plan import Asked
from swarmwire.deploy.campaign.vary import vary_from

FORMAT = 1
TYPES: dict[str, tuple[type, ...]] = {
    "format": (int,),
    "scenario": (str,),
    "name": (str,),
    "seeds": (int, str, list),
    "design": (str,),
    "points": (int,),
    "design_seed": (int,),
    "vary": (dict,),
    "overrides": (list,),
    "batch": (int,),
    "series": (bool,),
    "record_seeds": (int, str, list),
}
WORDS = {int: "a whole number", str: "a text", list: "a list", dict: "a table", bool: "true or false"}
OF_SCENARIOS = ("arena", "robots", "duration_s")  # keys that a campaign never has


def campaign_table(path: Path) -> dict[str, Any] | None:
    """The content of a campaign's file, its keys and types checked; None if the file describes a scenario instead.

    BadInput if it cannot be read, or has a key that is unknown, missing or of another type.
    """
    where = str(path)
    table = read_toml(path)
    if "scenario" not in table and any(key in table for key in OF_SCENARIOS):
        return None
    check_format(table, FORMAT, where)
    for key, value in table.items():
        if key not in TYPES:
            raise BadInput(where, key, f"unknown key; expected {did_you_mean(TYPES, key)}")
        if type(value) not in TYPES[key]:
            raise BadInput(where, key, f"expected {' or '.join(WORDS[of] for of in TYPES[key])}, got {value!r}")
    if "scenario" not in table:
        raise BadInput(where, "scenario", f"is missing: expected {WORDS[TYPES['scenario'][0]]}")
    return table


def asked_in(path: Path, table: Mapping[str, Any]) -> Asked:
    """What a campaign's file asks for; a scenario's path is as seen from the file. BadInput names the key."""
    where = str(path)
    if "seeds" not in table:
        raise BadInput(where, "seeds", f"is missing: expected {SEEDS}")
    vary = cast("dict[str, Any]", table.get("vary", {}))
    overrides = cast("list[Any]", table.get("overrides", []))
    if not all(isinstance(text, str) for text in overrides):
        raise BadInput(where, "overrides", f"expected texts such as duration_s=60, got {overrides}")
    recorded = table.get("record_seeds", [])
    return Asked(
        scenario=path.parent / table["scenario"],
        seeds=seed_list(table["seeds"], f"{where}: seeds"),
        varied=tuple(vary_from(key, given, f"{where}: vary.{key}") for key, given in _flat(vary).items()),
        design=table.get("design", GRID),
        points=table.get("points"),
        design_seed=table.get("design_seed", 1),
        overrides=tuple(overrides),
        name=table.get("name"),
        batch=table.get("batch"),
        series=table.get("series", True),
        record_seeds=seed_list(recorded, f"{where}: record_seeds") if recorded else (),
    )


def _flat(vary: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """By path: a key without quotes, such as radio.loss, is a table within a table to TOML."""
    flat: dict[str, Any] = {}
    for key, value in vary.items():
        if isinstance(value, dict) and not {"from", "to"} & set(cast("dict[str, Any]", value)):
            flat.update(_flat(cast("dict[str, Any]", value), f"{above}{key}."))
        else:
            flat[f"{above}{key}"] = value
    return flat
