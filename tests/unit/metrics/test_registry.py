"""Which metrics a run measures: those of its scenario, of packages, and the user's own."""

import re
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.errors import CustomCodeFailed
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.metric import Metric, metric_info
from swarmwire.metrics.measures.registry import (
    ENTRY_POINT_GROUP,
    METRICS,
    MetricEntry,
    PlugIn,
    custom_metric_class,
    plug_ins,
    select_metrics,
    standard_names,
)
from tests.support.custom_code import CODE, install
from tests.support.metrics.truths import static, truth
from tests.support.refusals import refused_input


@pytest.fixture
def east(tmp_path: Path) -> str:
    (tmp_path / "own.py").write_text(CODE)
    return f"{tmp_path / 'own.py'}:East"


def item(spec, index=0, **params):
    return MetricEntry(f"metrics.{index}.metric" if params else f"metrics.{index}", spec, params)


def stop(spec):
    return MetricEntry("stop.metric", spec, None)


def names(*items, **options):
    return [metric.name for metric in select_metrics(items, "s.toml", **options).metrics]


def refused(*items, key, match):
    with refused_input("s.toml", key, match):
        select_metrics(items, "s.toml")


def test_without_a_list_the_standard_ones_are_measured():
    assert names() == standard_names()


def test_listed_ones_stand_behind_the_standard_ones_in_their_order(monkeypatch, east):
    monkeypatch.setattr(METRICS["order"], "standard", False)
    monkeypatch.setattr(METRICS["airtime"], "standard", False)
    assert names(item("order"), item(east, 1), item("airtime", 2)) == [*standard_names(), "order", "east", "airtime"]


def test_without_the_standard_ones_there_is_what_is_listed(east):
    assert names(item(east), item("order", 1), with_standard=False) == ["east", "order"]
    assert names(with_standard=False) == []


def test_standard_metric_that_is_listed_keeps_its_place_with_parameters():
    metrics = select_metrics([item("fragmentations", hold_s=3)], "s.toml").metrics
    assert [metric.name for metric in metrics] == standard_names()
    assert METRICS["fragmentations"](hold_s=3.0) in metrics
    assert select_metrics([item("order")], "s.toml") == select_metrics([], "s.toml")


def test_metric_class_of_a_file_takes_parameters_and_is_noted_as_code(east):
    selected = select_metrics([item(east, from_m=2)], "s.toml", with_standard=False)
    assert [(metric.name, metric.from_m) for metric in selected.metrics] == [("east", 2.0)]
    assert selected.code == (east,)


def test_stop_metric_is_measured_once_with_its_listed_parameters(east):
    assert names(stop("order"), with_standard=False) == ["order"]
    assert names(item(east), stop("east"), with_standard=False) == ["east"]
    [only] = select_metrics([item("fragmentations", hold_s=3), stop("fragmentations")], "", with_standard=False).metrics
    assert only == METRICS["fragmentations"](hold_s=3.0)
    assert names(stop("order"), stop("order")) == standard_names()


@pytest.mark.parametrize(
    ("entry", "key", "hint"),
    [
        (item("ordre"), "metrics.0", "did you mean order?"),
        (item("ordre", x=1), "metrics.0.metric", "did you mean order?"),
        (stop("ordr"), "stop.metric", "did you mean order?"),
        (item("mine.py"), "metrics.0", "mine.py"),
        (item("fragmentations", hold=1), "metrics.0.hold", "hold_s (did you mean this?)"),
        (item("fragmentations", hold_s=-1), "metrics.0.hold_s", "-1.0"),
        (item("pdr", window_s=1e9), "metrics.0.window_s", "86400"),  # two numbers for each tick of the window
        (item("fragmentations", hold_s="x"), "metrics.0.hold_s", "'x'"),
        (item("order", gap_m=1), "metrics.0.gap_m", "none"),
    ],
)
def test_unknown_metric_or_parameter_is_refused_with_its_key(entry, key, hint):
    refused(entry, key=key, match=re.escape(hint))


def test_metric_listed_twice_is_refused(east):
    for spec, params, key in (("order", {}, "metrics.1"), (east, {"from_m": 1}, "metrics.1.metric")):
        refused(item(spec), item(spec, 1, **params), key=key, match=r"metrics\.0")


@pytest.fixture
def site(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path / "site")
    return tmp_path / "site"


def test_package_provides_metrics_by_name(site):
    install(site, "compass_metrics", {"east": "East"})
    selected = select_metrics([item("east", from_m=1)], "s.toml", with_standard=False)
    assert [metric.from_m for metric in selected.metrics] == [1.0]
    assert selected.code == ("compass_metrics:East",)
    assert names(stop("east"), with_standard=False) == ["east"]
    refused(item("eest"), key="metrics.0", match=r"east\?")


def test_plug_in_is_imported_only_if_it_is_listed(site):
    install(site, "broken_metrics", {"east": "East"}, code="raise ValueError('no such day')")
    assert names() == standard_names()
    refused(item("east"), key="metrics.0", match="broken_metrics.*no such day")


@pytest.mark.parametrize(
    ("packages", "hint"),
    [(["named_metrics"], "named_metrics:East.*'west'"), (["one_metrics", "more_metrics"], "'west'.*package")],
)
def test_plug_in_with_another_name_or_from_two_packages_is_refused(site, packages, hint):
    for package in packages:
        install(site, package, {"west": "East"})
    refused(item("west"), key="metrics.0", match=hint)


def test_plug_in_cannot_replace_a_built_in_metric(site):
    install(site, "taken_metrics", {"order": "East"})
    assert type(select_metrics([item("order")], "s.toml", with_standard=False).metrics[0]) is METRICS["order"]


def test_plug_ins_are_known_by_name_without_an_import(tmp_path, monkeypatch):
    install(tmp_path, "compass_metrics", {"east": "East"}, code="raise RuntimeError")
    monkeypatch.syspath_prepend(tmp_path)
    assert plug_ins()["east"] == PlugIn("east", "compass_metrics:East", "compass_metrics", twice=False)
    assert f"[{ENTRY_POINT_GROUP}]" in (tmp_path / "compass_metrics-1.0.dist-info" / "entry_points.txt").read_text()


@dataclass(frozen=True)
class Good(Metric):
    """The tick."""

    name = "mine"
    help = "the tick"
    bounds = (0, None)

    def begin(self, static: Any) -> Any:
        return lambda moment: float(moment.truth.tick)


class Plain(Metric):
    """No dataclass."""


@dataclass(frozen=True)
class Endless(Metric):
    """Begins nothing."""


@dataclass(frozen=True)
class BeginsBadly(Good):
    """Raises before the first tick."""

    def begin(self, static: Any) -> Any:
        raise ValueError("no start")


@dataclass(frozen=True)
class Wide(Good):
    """Has a value per robot."""

    def begin(self, static: Any) -> Any:
        return lambda moment: moment.heading_rad[0]


def spec_of(kind: type) -> str:
    return f"{__name__}:{kind.__name__}"


def test_custom_metric_is_measured():
    assert _measure(custom_metric_class(spec_of(Good), "s.toml", "metrics.0")()).latest["mine"].tolist() == [7.0]


@pytest.mark.parametrize("bounds", [(None, None), (None, 1.0), (-inf, None), (0, 1)])
def test_bounds_of_a_metric_are_numbers_or_none(monkeypatch, bounds):
    monkeypatch.setattr(Good, "bounds", bounds)
    kind = custom_metric_class(spec_of(Good), "s.toml", "metrics.0")
    assert metric_info(kind).bounds == tuple(None if bound in (None, -inf) else bound for bound in bounds)


@pytest.mark.parametrize(
    ("kind", "hint"), [(Plain, "dataclass.*:Plain"), (Endless, "Endless.*begin"), (str, "no such name.*'str'")]
)
def test_class_that_is_no_metric_is_refused(kind, hint):
    with refused_input("s.toml", "metrics.0", hint):
        custom_metric_class(spec_of(kind), "s.toml", "metrics.0")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("name", value) for value in ("two words", "order", "x_m", "link_pdr")),
        *(("unit", 3), ("kind", "sum"), ("needs", ("range",)), ("bounds", (0.0,)), ("bounds", (0.0, "1"))),
    ],
)
def test_custom_metric_with_a_wrong_attribute_is_refused(monkeypatch, name, value):
    monkeypatch.setattr(Good, name, value)
    with refused_input("s.toml", "metrics.0", match=f"Good: .*{name}.*{re.escape(repr(value))}"):
        custom_metric_class(spec_of(Good), "s.toml", "metrics.0")


@pytest.mark.parametrize(("kind", "text"), [(BeginsBadly, "no start"), (Wide, "could not broadcast")])
def test_custom_metric_that_fails_is_named(kind, text):
    with pytest.raises(CustomCodeFailed, match=rf"mine \({kind.__name__}\)[\s\S]*{text}"):
        _measure(kind())


def _measure(metric):
    metrics, run = Metrics([metric]), static(3)
    metrics.begin(run)
    metrics.see(truth(run, 7, pose=np.zeros((3, 3))))
    return metrics
