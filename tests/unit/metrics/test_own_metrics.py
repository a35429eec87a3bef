"""Metrics of the user's own at the door: good ones are measured like the others, bad ones are refused in one line."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput, OwnCodeFailed
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.own_metrics import own_kind
from tests.support.metrics.truths import static, truth


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


def spec(kind: type) -> str:
    return f"{__name__}:{kind.__name__}"


def test_a_good_one_is_measured():
    assert _measure(own_kind(spec(Good), "s.toml", "metrics.0")()).latest["mine"].tolist() == [7.0]


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        (Plain, "expected a dataclass below Metric; .*:Plain is <class"),
        (Endless, "Endless has no begin"),
        (str, ".* holds no such name: 'str'"),
    ],
)
def test_a_class_that_is_no_metric_is_refused(kind, said):
    with pytest.raises(BadInput, match=rf"^s.toml: metrics\.0: {said}"):
        own_kind(spec(kind), "s.toml", "metrics.0")


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("name", "two words", "a name of letters, digits and _; got 'two words'"),
        ("name", "order", "a name that is not taken; got 'order'"),
        ("name", "x_m", "a name that is not taken; got 'x_m'"),
        ("name", "delivery", "a name that is not taken; got 'delivery'"),
        ("unit", 3, "unit as a text; got 3"),
        ("kind", "sum", "the kind level or count or time; got 'sum'"),
        ("bounds", (None, 1.0), r"bounds as a number, and a number or None; got \(None, 1.0\)"),
    ],
)
def test_an_attribute_that_is_wrong_is_refused(monkeypatch, name, value, said):
    monkeypatch.setattr(Good, name, value)
    with pytest.raises(BadInput, match=rf"^s.toml: metrics\.0: Good: expected {said}"):
        own_kind(spec(Good), "s.toml", "metrics.0")


@pytest.mark.parametrize(("kind", "said"), [(BeginsBadly, "no start"), (Wide, "could not broadcast")])
def test_one_that_fails_is_named(kind, said):
    with pytest.raises(OwnCodeFailed, match=rf"the metric mine \({kind.__name__}\) failed:[\s\S]*{said}"):
        _measure(kind())


def _measure(metric):
    metrics, of = Metrics([metric]), static(3)
    metrics.begin(of)
    metrics.see(truth(of, 7, pose=np.zeros((3, 3))))
    return metrics
