import json
from dataclasses import dataclass

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.parameters import parameter
from swarmwire.comms.protocols import Observer
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.registry import METRICS, register
from swarmwire.metrics.swarm.order import Order
from tests.support.metrics.truths import edges, poses, static, truth


@dataclass(frozen=True)
class Turned(Metric):
    """Robots whose heading is above a threshold."""

    above_rad: float = parameter(0.0, help="threshold", unit="rad")

    name = "turned"
    help = "robots with a heading above a threshold"
    bounds = (0.0, None)

    def begin(self, static):
        return lambda moment: np.count_nonzero(moment.heading_rad > self.above_rad, axis=1).astype(np.float64)


def seen(metrics, of, *ticks):
    metrics.begin(of)
    for tick, fields in enumerate(ticks):
        metrics.see(truth(of, tick, **fields))
    return metrics.end(None)["metrics"]


def test_a_level_has_final_mean_min_and_max_over_the_ticks():
    of = static(2)
    [found] = seen(Metrics(["order"]), of, *({"pose": poses([0.0, turn])} for turn in (0.0, np.pi, np.pi / 2)))
    half = np.sqrt(0.5)
    expected = {"final": half, "mean": (1 + half) / 3, "min": 0.0, "max": 1.0}
    assert found["order"] == {name: pytest.approx(value, abs=1e-15) for name, value in expected.items()}


def test_a_count_ends_with_its_total_and_has_statistics_of_what_a_tick_added():
    of = static(2, arenas=2)
    onsets = ({"contact_onsets": np.array(pairs)} for pairs in ([[1, 0], [0, 2]], [[0, 0], [0, 2]], [[3, 0], [0, 0]]))
    first, second = seen(Metrics(), of, *onsets)
    assert first["collisions"] == {"final": 4.0, "mean": pytest.approx(4 / 3), "min": 0.0, "max": 3.0}
    assert second["collisions"] == {"final": 0.0, "mean": 0.0, "min": 0.0, "max": 0.0}
    assert second["wall_contacts"] == {"final": 4.0, "mean": pytest.approx(4 / 3), "min": 0.0, "max": 2.0}


def test_latest_is_the_value_of_a_level_and_the_total_of_a_count():
    of, metrics = static(2), Metrics()
    ticks = ({"pose": poses([0.0, turn]), "contact_onsets": np.array([[1, 0]])} for turn in (np.pi, 0.0))
    seen(metrics, of, *ticks)
    assert metrics.latest["order"].tolist() == [1.0]
    assert metrics.latest["collisions"].tolist() == [2.0]


def test_ticks_without_a_value_are_left_out_and_what_never_had_one_is_null():
    of = static(2, radio=False)
    dead = {"alive": np.zeros(2, np.bool_)}
    [found] = seen(Metrics(), of, {"pose": poses([0.0, 0.0])}, dead)
    assert found["order"] == {"final": None, "mean": 1.0, "min": 1.0, "max": 1.0}
    assert found["largest_component"] == dict.fromkeys(("final", "mean", "min", "max"))


def test_a_run_without_a_tick_has_null_everywhere():
    [found] = seen(Metrics(["order"]), static())
    assert found["order"] == dict.fromkeys(("final", "mean", "min", "max"))


def test_the_summary_is_plain_json():
    of = static(3, arenas=2)
    found = seen(Metrics(), of, {"edges": edges((0, 1))})
    assert json.loads(json.dumps(found, allow_nan=False)) == found


def test_one_object_serves_many_runs():
    of, metrics = static(2), Metrics()
    first = seen(metrics, of, {"contact_onsets": np.array([[5, 5]])})
    assert seen(metrics, of, {"contact_onsets": np.array([[5, 5]])}) == first


def test_a_metric_with_parameters_is_given_as_an_object():
    of = static(3)
    [found] = seen(Metrics(["order", Turned(above_rad=1.0)]), of, {"pose": poses([0.0, 2.0, 3.0])})
    assert list(found) == ["order", "turned"]
    assert found["turned"]["final"] == 2.0


def test_a_registered_metric_is_measured_by_name(monkeypatch):
    monkeypatch.setattr("swarmwire.metrics.registry.METRICS", dict(METRICS))
    register(Turned)
    assert [metric.name for metric in Metrics(["turned"]).metrics] == ["turned"]


@pytest.mark.parametrize("taken", ["order", "delivery"])
def test_a_name_that_is_taken_is_refused(taken):
    class Other(Turned):
        name = taken

    with pytest.raises(BadInput, match=rf"metrics\.{taken}: expected a name that is not taken"):
        register(Other)


def test_an_unknown_name_is_refused_with_those_that_are_known():
    with pytest.raises(BadInput, match=r"expected some of order, .*; got 'ordre'"):
        Metrics(["ordre"])


@pytest.mark.parametrize("names", [["order", "order"], ["order", Order()]])
def test_a_name_given_twice_is_refused(names):
    with pytest.raises(BadInput, match="'order' is named twice"):
        Metrics(names)


@pytest.mark.parametrize("name", METRICS)
def test_a_metric_stays_within_its_bounds(name):
    of, rng = static(5, arenas=40), np.random.default_rng(2)
    low, high = METRICS[name].bounds
    pairs = rng.integers(0, 5, (150, 2)) + 5 * rng.integers(0, 40, (150, 1))
    metrics = Metrics([name])
    fields = {
        "pose": poses(rng.uniform(-np.pi, np.pi, 200)),
        "alive": rng.random(200) < 0.7,
        "edges": pairs,
        "contact_onsets": rng.integers(0, 3, (40, 2)),
    }
    for found in seen(metrics, of, fields):
        value = found[name]["final"]
        assert value is None or low <= value <= (np.inf if high is None else high)


def test_metrics_are_an_observer():
    observer: Observer = Metrics()
    assert observer.end.__doc__
