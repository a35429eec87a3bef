"""What the tables of parity say."""

from math import nan

import numpy as np

from swarmwire.metrics.parity.parity import MetricRow, RadioRow, Spread
from swarmwire.metrics.parity.parity_texts import COLUMNS, RADIO_COLUMNS, metric_cells, radio_cells
from swarmwire.metrics.parity.radio_values import RadioValue
from swarmwire.metrics.registry import METRICS
from swarmwire.metrics.statistics.interval import UNKNOWN

NOTHING = np.empty(0)


def test_a_metric_has_a_text_for_each_column():
    row = MetricRow(METRICS["min_gap"](), Spread(0.1, 0.2, 0.3), 0.25, 0.125, 0.05, 0.04, UNKNOWN, (NOTHING,), NOTHING)
    cells = dict(zip(COLUMNS, metric_cells(row), strict=True))
    assert cells["metric"].startswith("min_gap")
    assert cells["emulated"] == "0.2 (0.1 to 0.3)"
    assert (cells["log"], cells["distance"], cells["spread"], cells["KS"]) == ("0.25", "0.05", "0.04", "0.125")
    assert cells["within"] == "no"


def test_a_single_run_has_a_value_and_no_spread():
    row = MetricRow(METRICS["order"](), Spread(0.5, 0.5, 0.5), 0.5, 0.0, 0.0, nan, UNKNOWN, (NOTHING,), NOTHING)
    cells = dict(zip(COLUMNS, metric_cells(row), strict=True))
    assert cells["emulated"] == "0.5"
    assert cells["within"] not in ("yes", "no")


def test_a_number_of_the_radio_has_a_text_for_each_column():
    value = RadioValue("latency, median", "s", "how long", (0.01, 0.02, 0.03), log=0.02, grain=0.0)
    row = RadioRow(value, Spread(0.01, 0.02, 0.03), 3)
    cells = dict(zip(RADIO_COLUMNS, radio_cells(row), strict=True))
    assert cells["radio"] == "latency, median [s]"
    assert (cells["log"], cells["within"]) == ("0.02", "yes")
