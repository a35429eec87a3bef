"""What metrics say of themselves is kept with a run, and drawn from there."""

import json
from dataclasses import asdict
from math import inf

import numpy as np
import pytest

from swarmwire.metrics.drawing.metrics_strip import is_count, limits, titled
from swarmwire.metrics.registry import METRICS
from swarmwire.metrics.run_folder.layout import MetricInfo, metric_info
from swarmwire.metrics.run_folder.reader import RunFolder

OWN = MetricInfo("gas", "what it smells of", "ppm", "count", (0.0, None))


@pytest.mark.parametrize("name", METRICS)
def test_what_is_kept_of_a_metric_comes_back(tmp_path, name):
    facts = metric_info(METRICS[name])
    run = {"format": 1, "metrics": [asdict(facts), asdict(OWN)]}
    (tmp_path / "run.json").write_text(json.dumps(run, allow_nan=False))
    assert RunFolder(tmp_path).measured == {name: facts, "gas": OWN}
    least, largest = METRICS[name].bounds
    assert facts.bounds == (None if least == -inf else least, largest)


@pytest.mark.parametrize("metrics", ["", ', "metrics": 3', ', "metrics": [{"name": "gas"}]'])
def test_of_a_damaged_list_nothing_is_known(tmp_path, metrics):
    (tmp_path / "run.json").write_text(f'{{"format": 1{metrics}}}')
    assert RunFolder(tmp_path).measured == {}


@pytest.mark.parametrize("text", [None, "{", "[]"])
def test_without_a_readable_file_nothing_is_known(tmp_path, text):
    if text is not None:
        (tmp_path / "run.json").write_text(text)
    assert RunFolder(tmp_path).started == RunFolder(tmp_path).measured == {}


def test_an_axis_is_that_of_what_the_metric_said():
    facts = {"gas": OWN, "share": MetricInfo("share", "", "", "level", (0.0, 1.0))}
    assert (titled("gas", facts), titled("gas")) == ("gas (ppm)", "gas")
    assert (is_count("gas", facts), is_count("gas")) == (True, False)
    assert limits("share", np.array([0.4]), facts) == limits("order", np.array([0.4])) == (-0.03, 1.05)
    assert limits("share", np.array([0.4]))[1] < 0.5
    assert (titled("min_gap"), is_count("collisions")) == ("min gap (m)", True)
