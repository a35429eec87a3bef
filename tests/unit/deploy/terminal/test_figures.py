"""The figures that people see while a run goes on."""

import numpy as np

from swarmwire.comms.clock import WallClock
from swarmwire.deploy.terminal.figures import Figures
from swarmwire.metrics.metrics import Metrics
from tests.support.metrics.truths import static, truth


def test_arenas_that_have_stopped_are_told_once_there_are_any():
    of, metrics = static(2, arenas=3), Metrics(["order"])
    figures = Figures(10, metrics, WallClock())
    metrics.begin(of)
    figures.begin(of)
    told = []
    for tick, running in enumerate(([1, 1, 1], [1, 0, 1], [0, 0, 1])):
        now = truth(of, tick, running=np.array(running, np.bool_))
        metrics.see(now)
        figures.see(now)
        told.append(figures.gone)
    assert told == ["", ", 2 of 3 arenas go on", ", 1 of 3 arenas go on"]
