from dataclasses import replace

import numpy as np
import pytest

from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.registry import METRICS
from tests.support.metrics.swarm.swarms import rolled
from tests.support.metrics.truths import static, truth

ROBOTS, ARENAS = 7, 3
ROWS = ROBOTS * ARENAS
SWARM_METRICS = [name for name, kind in METRICS.items() if ".metrics.swarm." in kind.__module__]


def ticks_of_a_run(boundary):
    rng = np.random.default_rng(1)
    place = np.cumsum(rng.normal(0.0, 0.1, (110, ROWS, 2)), axis=0)
    for tick in range(110):
        at = rolled(place[tick]) if boundary == "torus" else place[tick]
        yield {
            "tick": tick,
            "pose": np.column_stack([at, rng.uniform(-np.pi, np.pi, ROWS)]),
            "velocity": rng.normal(size=(ROWS, 3)),
            "command": rng.normal(size=(ROWS, 3)),
            "alive": rng.random(ROWS) < 0.95,
            "contact_onsets": rng.integers(0, 3, (ARENAS, 2)),
        }


@pytest.mark.parametrize("boundary", ["walls", "torus"])
def test_an_arena_alone_has_what_it_has_beside_others_to_the_last_bit(boundary):
    together, alone = Metrics(SWARM_METRICS), [Metrics(SWARM_METRICS) for _ in range(ARENAS)]
    three = replace(static(ROBOTS, arenas=ARENAS), boundary=boundary)
    one = replace(static(ROBOTS), boundary=boundary)
    together.begin(three)
    for metrics in alone:
        metrics.begin(one)
    for fields in ticks_of_a_run(boundary):
        together.see(truth(three, **fields))
        for arena, metrics in enumerate(alone):
            own = {name: value if name == "tick" else np.split(value, ARENAS)[arena] for name, value in fields.items()}
            metrics.see(truth(one, **own))
            assert metrics.values[:, 0].tobytes() == together.values[:, arena].tobytes()
    assert np.isfinite(together.values).sum() > 2 * len(SWARM_METRICS)
