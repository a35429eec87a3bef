"""The picture of a radio's coverage is written for a disk and for signals."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.air.probe.survey import Band, ByDistance, CoverageMap
from swarmwire.metrics.drawing.coverage_sheet import draw_coverage
from tests.support.metrics.truths import static

pytest.importorskip("matplotlib", reason="needs the extra [report]")

X_M, Y_M = np.linspace(-3.5, 3.5, 8), np.linspace(-2.5, 2.5, 6)
NEAR = np.hypot(X_M, Y_M[:, None]) < 2.0
SIGNALS = CoverageMap((0.0, 0.0), X_M, Y_M, np.where(NEAR, -60.0, -95.0), NEAR, NEAR * 1.0, np.ones_like(NEAR))
DISTANCES = np.array([0.5, 1.5, 2.5])
DELIVERY = Band(*np.array([[1.0, 0.8, 0.0], [1.0, 0.5, 0.0], [1.0, 1.0, 0.0]]))
STRENGTH = Band(*np.array([[-50.0, -70.0, -90.0]] * 3))


@pytest.mark.parametrize(
    ("found", "strength", "sensitivity_dbm"),
    [(SIGNALS, STRENGTH, -90.0), (replace(SIGNALS, mean_dbm=None), None, None)],
)
def test_a_picture_is_written(tmp_path, found, strength, sensitivity_dbm):
    to = tmp_path / "coverage.png"
    draw_coverage(static(3), found, ByDistance(DISTANCES, DELIVERY, strength), sensitivity_dbm, "a radio", to, 400)
    assert to.read_bytes().startswith(b"\x89PNG")
