"""The kinds of things that a scenario, an agent or a command can name, and the search for one of them by its name."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.catalogue.agents import behaviour, behaviours, drivers, gateways, message_fields
from swarmwire.deploy.catalogue.robots import bodies, body_of, drives, sensors, sheet_keys
from swarmwire.deploy.catalogue.scenario import engines, events, fates, keys, metrics, presets, radio_keys, radio_stages
from swarmwire.deploy.catalogue.schema import Entry
from swarmwire.world.scenario.bodies import sheet_path


@dataclass(frozen=True)
class Kind:
    """One kind."""

    name: str  # as in `swarmwire list NAME`
    one: str  # as in `swarmwire describe ONE:name`, and the `kind` of its entries
    help: str  # one line
    entries: Callable[[], list[Entry]]


KINDS = (
    Kind("bodies", "body", "kinds of robot: size, drive and sensors", bodies),
    Kind("drives", "drive", "what may move a body, with the keys of its table", drives),
    Kind("body-keys", "body-key", "keys of a body's file; its drive and sensors are kinds of their own", sheet_keys),
    Kind("sensors", "sensor", "what an agent may read of its robot and of packets, if its needs name it", sensors),
    Kind("behaviours", "behaviour", "agents that come with swarmwire, with their parameters", behaviours),
    Kind("fields", "field", "types of a message's fields", message_fields),
    Kind("events", "event", "what may happen to robots and radios on the way", events),
    Kind("metrics", "metric", "what can be measured of a run; the standard ones are in every run", metrics),
    Kind("radio", "radio", "keys of a scenario's radio", radio_keys),
    Kind("presets", "preset", "kinds of radio that a scenario may name", presets),
    Kind("stages", "stage", "what a packet passes on its way to a receiver, in order", radio_stages),
    Kind("fates", "fate", "what may become of a packet for one receiver", fates),
    Kind("engines", "engine", "what moves the bodies of a run", engines),
    Kind("drivers", "driver", "real robots that swarmwire-agent can drive", drivers),
    Kind("gateways", "gateway", "real robots that robots of a run can answer as", gateways),
    Kind("keys", "key", "all other keys of a scenario", keys),
)


def kind_named(name: str) -> Kind:
    """The kind of this name, singular or plural; BadInput if there is none."""
    found = next((kind for kind in KINDS if name.lower() in (kind.name, kind.one)), None)
    if found is None:
        kinds = did_you_mean((kind.name for kind in KINDS), name)
        raise BadInput(name, "", f"expected {kinds}; swarmwire describe tells about a single thing")
    return found


def find(name: str) -> Entry:
    """What `name` names: alone, as "kind:name", an agent as "module:Class" or "file.py:Class", a body as "sheet.toml".

    Keys of a scenario may leave out how they begin, as far as that is clear, and may hold a group's name for `*`.
    BadInput if nothing has the name, with the nearest that there are, or if several things have it.
    """
    if sheet_path(name, ""):
        return body_of(Path(name))
    if name.endswith(".py"):
        raise BadInput(name, "", f"expected the class in it, too: {name}:Class")
    before, colon, rest = name.partition(":")
    chosen = [kind for kind in KINDS if colon and before.lower() in (kind.name, kind.one)]
    if colon and not chosen:
        return behaviour(name)
    entries = [entry for kind in chosen or KINDS for entry in kind.entries()]
    asked = rest if chosen else name
    found = (
        [entry for entry in entries if entry.name == asked]  # Aggregation is a behaviour, aggregation a metric
        or [entry for entry in entries if _is(entry.name, asked)]
        or [entry for entry in entries if _is(entry.name, asked, ends=True)]
    )
    if not found:
        raise BadInput(name, "", _nearest(asked, entries))
    if len(found) > 1:
        raise BadInput(name, "", f"several things have this name; say which: {', '.join(_full_names(found))}")
    return found[0]


def _is(name: str, asked: str, ends: bool = False) -> bool:
    """Whether `asked` is the name, whole or how it `ends`, part by part; a `*` in it is any part."""
    parts, wanted = name.lower().split("."), asked.lower().split(".")
    if ends:
        parts = parts[-len(wanted) :]
        if parts[-1] != wanted[-1]:  # else any word would name the table robots.*
            return False
    return len(parts) == len(wanted) and all(part in ("*", want) for part, want in zip(parts, wanted, strict=True))


def _full_names(entries: Sequence[Entry]) -> list[str]:
    names = [entry.name for entry in entries]
    return names if len(set(names)) == len(names) else [f"{entry.kind}:{entry.name}" for entry in entries]


def _nearest(asked: str, entries: Sequence[Entry]) -> str:
    """What to try instead: the names nearest to the one asked for, or to the last part of a path."""
    if any(asked.lower() in (kind.name, kind.one) for kind in KINDS):
        return f"this is a kind of things; swarmwire list {kind_named(asked).name} names them"
    names = {entry.name.lower(): entry.name for entry in entries}
    names |= {entry.name.rpartition(".")[2].lower(): entry.name for entry in reversed(entries) if "." in entry.name}
    close = dict.fromkeys(names[match] for match in get_close_matches(asked.lower(), names, n=4, cutoff=0.6))
    nearest = f"nearest: {', '.join(close)}" if close else "nothing is near it"
    return f"nothing has this name; {nearest} (swarmwire list names all)"
