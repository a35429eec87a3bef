"""Metrics: what can be measured of a run, swarmwire's own and those that installed packages bring."""

import json
from abc import ABC
from math import isinf

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.catalogue.docs import texts_of
from swarmwire.deploy.catalogue.entry import Entry, ParameterTable
from swarmwire.deploy.catalogue.schema_parameters import parameters_of_dataclass
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.plug_ins import GROUP, PlugIn, plug_ins
from swarmwire.metrics.registry import METRICS

KINDS = {
    "level": "level: a state at each tick",
    "count": "count: what happened within a tick, added up over the run",
    "time": "time: when something happened, in s from the start of the run; none if it did not",
}


def metrics() -> list[Entry]:
    """The metrics of the registry, then those of packages; one that does not import says so."""
    own = [_metric(kind, "standard" if kind.standard else "") for kind in METRICS.values()]
    return [*own, *(_plug_in(of) for of in plug_ins().values() if of.name not in METRICS)]


def _plug_in(of: PlugIn) -> Entry:
    try:
        return _metric(of.kind("", ""), "plug-in", ("brought by", f"{of.package}, as {of.spec}"))
    except BadInput as fault:
        where = (("brought by", f"{of.package}, as {of.spec}, in the entry points {GROUP}"),)
        return Entry("metric", of.name, f"cannot be measured: {fault.expected}", facts=where, mark="plug-in")


def _metric(kind: type[Metric], mark: str, *facts: tuple[str, str]) -> Entry:
    parameters = parameters_of_dataclass(kind)
    return Entry(
        kind="metric",
        name=kind.name,
        help=kind.help,
        facts=(
            ("measured", _measured(kind, mark)),
            ("in summary.json", f"metrics.{kind.name}: final, mean, min and max over the ticks"),
            ("kind", KINDS[kind.kind]),
            ("unit", kind.unit or "none"),
            ("bounds", _bounds(*kind.bounds)),
            *facts,
        ),
        tables=(ParameterTable("parameters", parameters),) if parameters else (),
        mark=mark,
        text=texts_of(kind, (Metric, ABC, object)),
    )


def _measured(kind: type[Metric], mark: str) -> str:
    """When it is, and how a scenario lists it."""
    name, parameters = f'"{kind.name}"', parameters_of_dataclass(kind)
    given = [f"{of.name} = {'…' if of.value is None else json.dumps(of.value)}" for of in parameters]
    table = f"{{ {', '.join([f'metric = {name}', *given])} }}"
    if mark == "standard":
        return "in every run" + (f"; with other parameters where metrics = [{table}] says so" if given else "")
    plain = f"where a scenario says metrics = [{name}], or [stop] names it"
    return plain + (f"; with parameters, metrics = [{table}]" if given else "")


def _bounds(least: float, largest: float | None) -> str:
    if largest is not None:
        return f"{least:g} to {largest:g}"
    return "none" if isinf(least) else f"{least:g} and more"
