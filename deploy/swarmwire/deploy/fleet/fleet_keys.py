"""The keys of `fleet.toml`, and what each may be."""

from collections.abc import Iterable, Mapping
from typing import Any, cast

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput

FORMAT = 1
NUMBER = (int, float)
OF_FLEET: dict[str, tuple[type, ...]] = {
    "format": (int,),
    "swarm": (str,),
    "known_hosts": (str,),
    "certificates": (str,),
    "insecure": (bool,),
    "operator": (str,),
    "defaults": (dict,),
    "robots": (dict,),
    "groups": (dict,),
}
HOST_KEYS: dict[str, tuple[type, ...]] = {  # of the way to a robot
    "address": (str,),
    "user": (str,),
    "port": (int,),
    "key": (str,),
    "python": (str,),
    "network_address": (str,),
    "network_port": (int,),
    "groups": (list,),
    "packages": (list,),
}
SETTINGS: dict[str, tuple[type, ...]] = {  # of the agent, as in robot.toml, which says more of each
    "agent": (str,),
    "params": (dict,),
    "body": (str,),
    "rate_hz": (int,),
    "watchdog_s": NUMBER,
    "max_linear_mps": NUMBER,
    "max_angular_radps": NUMBER,
    "driver": (dict,),
    "radio": (dict,),
    "tracker": (bool,),
    "seed": (int,),
}
OF_ROBOT = {**HOST_KEYS, **SETTINGS}
WORDS = {int: "a whole number", float: "a number", str: "a text", list: "a list of texts", dict: "a table"}
WORDS[bool] = "true or false"
PORTS = ("port", "network_port")


def checked_table(value: object, known: Mapping[str, tuple[type, ...]], where: str, key: str) -> dict[str, Any]:
    """A table whose keys are known and of their types; BadInput names the first that is not.

    A key that is known without a type is one of others' tables: it has no place here.
    """
    if not isinstance(value, dict):
        raise BadInput(where, key, f"expected a table, got {value!r}")
    table = cast("dict[str, Any]", value)
    here = [name for name, types in known.items() if types]
    for name, item in table.items():
        whole = f"{key}.{name}" if key else name
        if name not in here:
            raise BadInput(where, whole, f"unknown key; expected {did_you_mean(here, name)}")
        if type(item) not in known[name] or (list in known[name] and not _texts(item)):
            raise BadInput(where, whole, f"expected {WORDS[known[name][-1]]}, got {item!r}")
        if name in PORTS and not 1 <= item <= 65535:
            raise BadInput(where, whole, f"expected a port, 1 to 65535, got {item}")
        if item == "" and name in ("address", "user", "python", "swarm", "agent"):
            raise BadInput(where, whole, "expected a text that is not empty")
    return table


def _texts(items: Iterable[object]) -> bool:
    return all(isinstance(item, str) for item in items)
