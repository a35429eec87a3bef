"""Entries of keys of scenarios, presets, stages and fates of the radio, engines, events and metrics."""

import json
import sys
from abc import ABC
from dataclasses import fields, replace
from functools import cache
from math import isinf
from pathlib import Path
from typing import Any, cast

import numpy as np

from swarmwire.comms.base.config import bounds_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import resolve
from swarmwire.comms.radio.config.frames import airtime_ns
from swarmwire.comms.radio.config.presets import PRESETS, Preset
from swarmwire.comms.radio.phy.propagation import range_of
from swarmwire.comms.radio.stages.chain import ORDER
from swarmwire.comms.radio.stages.loss import FrameLoss
from swarmwire.comms.radio.stages.stage import Stage
from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy.cli.catalogue.schema import (
    CatalogueEntry,
    CatalogueParameter,
    ParameterTable,
    parameters_of_dataclass,
    parameters_of_schema,
)
from swarmwire.deploy.runs.scenario_parts import radio_of
from swarmwire.deploy.terminal.output import first_line, flowing, texts_of
from swarmwire.metrics.measures.metric import Metric
from swarmwire.metrics.measures.registry import ENTRY_POINT_GROUP, METRICS, PlugIn, custom_metric_class, plug_ins
from swarmwire.world.engines.physics import ENGINES
from swarmwire.world.events import ACTIONS
from swarmwire.world.events.event import Event
from swarmwire.world.scenario_file import scenario_schema


def keys() -> list[CatalogueEntry]:
    """Return all keys except the radio's."""
    return [_key(key, "key") for key in all_keys() if not _is_radio_key(key)]


def radio_keys() -> list[CatalogueEntry]:
    """Return the keys of the radio."""
    return [_key(key, "radio") for key in all_keys() if _is_radio_key(key)]


@cache
def all_keys() -> tuple[CatalogueParameter, ...]:
    """Return every key of a scenario, each after its table."""
    return parameters_of_schema(scenario_schema())


def _is_radio_key(key: CatalogueParameter) -> bool:
    return key.name == "radio" or key.name.startswith("radio.")


def _key(key: CatalogueParameter, kind: str) -> CatalogueEntry:
    inner = f"{key.name}."
    below = tuple(
        replace(child, name=child.name.removeprefix(inner)) for child in all_keys() if child.name.startswith(inner)
    )
    table = ParameterTable(f"keys of {key.name}", below) if below else ParameterTable("key", (key,))
    forms = (child.text for child in below if "." not in child.name and "`:" in child.text)
    text = [key.text, *forms]
    return CatalogueEntry(
        kind=kind,
        name=key.name,
        help=key.help,
        facts=(("in a scenario", _location(key, bool(below))),),
        tables=(table,),
        text="\n\n".join(filter(None, text)),
    )


def _location(key: CatalogueParameter, is_table: bool) -> str:
    """Return the location in the file, in the words of TOML."""
    if is_table:
        in_list = key.expected.startswith("a list")
        return f"the tables {_header(f'{key.name}.*')}" if in_list else f"the table {_header(key.name)}"
    table, _, name = key.name.rpartition(".")
    return f"{name} in {_header(table)}" if table else f"{name}, before the first table"


def _header(path: str) -> str:
    """Return the header of a table: "[robots.GROUP]", or "[[events]]" for a list."""
    lists = {key.name for key in all_keys() if key.expected.startswith("a list")}
    parts = path.split(".")
    is_index = [part == "*" and ".".join(parts[:depth]) in lists for depth, part in enumerate(parts)]
    names = ["GROUP" if part == "*" else part for part, index in zip(parts, is_index, strict=True) if not index]
    header = ".".join(names)
    return f"[[{header}]]" if is_index[-1] else f"[{header}]"


def presets() -> list[CatalogueEntry]:
    """Return all presets, with their values."""
    return [_preset(name, preset) for name, preset in PRESETS.items()]


def _preset(name: str, preset: Preset) -> CatalogueEntry:
    radio = radio_of(name, [])
    reach_m = range_of(radio)
    longest_ms = float(airtime_ns(radio, np.array([radio.overhead_bytes + radio.max_payload_bytes]))[0]) / 1e6
    facts = (
        ("in a scenario", f'[radio] preset = "{name}"'),
        ("source", preset.source),
        *((("but", preset.differences),) if preset.differences else ()),
        *((("reach", f"{float(f'{reach_m:.3g}'):g} m by path loss alone"),) if reach_m is not None else ()),
        ("longest frame", f"{longest_ms:.3g} ms"),
        *((f"radio.{path}", str(value)) for path, value in _flat(preset.radio)),
    )
    return CatalogueEntry(kind="preset", name=name, help=preset.summary, facts=facts)


def _flat(table: dict[str, Any], path: str = "") -> list[tuple[str, Any]]:
    pairs: list[tuple[str, Any]] = []
    for key, value in table.items():
        is_table = isinstance(value, dict) and bool(cast("dict[str, Any]", value))
        pairs += _flat(cast("dict[str, Any]", value), f"{path}{key}.") if is_table else [(path + key, value)]
    return pairs


def radio_stages() -> list[CatalogueEntry]:
    """Return the stages of the chain, in order."""
    return [_stage(kind, number) for number, kind in enumerate(ORDER, start=1)]


def _stage(kind: type[Stage | FrameLoss], number: int) -> CatalogueEntry:
    tables = tuple(f"radio.{key}." for key in kind.keys)
    keys = tuple(key for key in all_keys() if f"{key.name}.".startswith(tables))
    return CatalogueEntry(
        kind="stage",
        name=kind.name,
        help=first_line(kind.__doc__),
        facts=(("place", f"{number} of {len(ORDER)}"), ("in the chain", first_line(kind.create.__doc__))),
        tables=(ParameterTable("keys", keys),) if keys else (),
        text=flowing(kind.__doc__),
    )


def fates() -> list[CatalogueEntry]:
    """Return all fates, in the order of the tally's columns."""
    return [
        CatalogueEntry(
            kind="fate",
            name=fate.name.lower(),
            help=fate.meaning,
            facts=(("in summary.json", f"radio.fates.{fate.name.lower()}: intended receivers; all fates add up"),),
        )
        for fate in Fate
    ]


AUTO = "discs, or pymunk where an obstacle is movable; robots that fly or have no contacts are kinematic"


def engines() -> list[CatalogueEntry]:
    """Return the automatic choice, then each engine."""
    texts = {name: sys.modules[kind.__module__].__doc__ for name, kind in ENGINES.items()}
    return [_engine("auto", AUTO), *(_engine(name, first_line(text)) for name, text in texts.items())]


def _engine(name: str, text: str) -> CatalogueEntry:
    return CatalogueEntry("engine", name, text, (("in a scenario", f'engine = "{name}" in [physics]'),))


def events() -> list[CatalogueEntry]:
    """Return the actions of the registry."""
    return [_event(kind) for kind in ACTIONS]


def _event(kind: type[Event]) -> CatalogueEntry:
    do: Any = next(key for key in fields(kind) if key.name == "do")
    return CatalogueEntry(
        kind="event",
        name=do.default,
        help=bounds_of(do).help,
        facts=(
            ("in a scenario", f'do = "{do.default}" in [[events]]'),
            ("needs a radio", "with a PHY" if kind.needs_phy else "yes" if kind.needs_radio else "no"),
        ),
        tables=(ParameterTable("keys", parameters_of_dataclass(kind)),),
        text=flowing(kind.__doc__),
    )


METRIC_KINDS = {
    "level": "level: a state at each tick",
    "count": "count: number of occurrences within a tick, added up over the run",
    "time": "time: when something happened, in s from the start of the run; none if it did not",
}


def metrics() -> list[CatalogueEntry]:
    """Return the metrics of the registry, then those of packages, also those that cannot be imported."""
    built_in = [_metric(kind, "standard" if kind.standard else "") for kind in METRICS.values()]
    return [*built_in, *(_plug_in(plug_in) for plug_in in plug_ins().values() if plug_in.name not in METRICS)]


def custom_metric(spec: str) -> CatalogueEntry:
    """Return a user's metric, "module:Class" or "file.py:Class" in the working directory; BadInput if it is none."""
    return _metric(custom_metric_class(resolve(spec, Path.cwd()), spec, ""), "custom", spec=spec)


def _plug_in(plug_in: PlugIn) -> CatalogueEntry:
    try:
        return _metric(plug_in.kind("", ""), "plug-in", ("brought by", f"{plug_in.package}, as {plug_in.spec}"))
    except BadInput as fault:
        source = (("brought by", f"{plug_in.package}, as {plug_in.spec}, in the entry points {ENTRY_POINT_GROUP}"),)
        return CatalogueEntry(
            "metric", plug_in.name, f"cannot be measured: {fault.expected}", facts=source, mark="plug-in"
        )


def _metric(kind: type[Metric], mark: str, *facts: tuple[str, str], spec: str = "") -> CatalogueEntry:
    parameters = parameters_of_dataclass(kind)
    return CatalogueEntry(
        kind="metric",
        name=kind.name,
        help=kind.help,
        facts=(
            ("measured", _measured(kind, mark, spec or kind.name)),
            ("in summary.json", f"metrics.{kind.name}: final, mean, min and max over the ticks"),
            ("kind", METRIC_KINDS[kind.kind]),
            ("unit", kind.unit or "none"),
            ("bounds", _bounds(*kind.bounds)),
            *facts,
        ),
        tables=(ParameterTable("parameters", parameters),) if parameters else (),
        mark=mark,
        text=texts_of(kind, (Metric, ABC, object)),
    )


def _measured(kind: type[Metric], mark: str, spec: str) -> str:
    """Return when the metric is measured, and its form in a scenario."""
    name, parameters = f'"{spec}"', parameters_of_dataclass(kind)
    values = [f"{key.name} = {'…' if key.value is None else json.dumps(key.value)}" for key in parameters]
    table = f"{{ {', '.join([f'metric = {name}', *values])} }}"
    if mark == "standard":
        return "in every run" + (f"; with other parameters where metrics = [{table}] says so" if values else "")
    plain = f"where a scenario says metrics = [{name}]" + ("" if ":" in spec else ", or [stop] names it")
    return plain + (f"; with parameters, metrics = [{table}]" if values else "")


def _bounds(least: float | None, largest: float | None) -> str:
    match (None if least is None or isinf(least) else least, largest):
        case None, None:
            return "none"
        case None, most:
            return f"at most {most:g}"
        case low, None:
            return f"{low:g} and more"
        case low, most:
            return f"{low:g} to {most:g}"
