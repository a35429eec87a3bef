"""The shipped swarm of wanderers keeps moving and hardly ever touches anything."""

import numpy as np
import pytest

from swarmwire.comms.interfaces import Observer
from swarmwire.deploy import run
from tests.support.deploy.commands import ROOT

SPEED_MPS, DURATION_S = 0.08, 60.0


class Travel(Observer):
    """Observer of how far each robot went, half by half of the run, in m."""

    def begin(self, static):
        self.gone_m = np.zeros((2, static.robots))

    def see(self, truth):
        half = int(truth.time_ns >= DURATION_S / 2 * 1e9)
        self.gone_m[half] += np.hypot(truth.velocity[:, 0], truth.velocity[:, 1]) / 10


@pytest.mark.parametrize("seed", [1, 2])
def test_twenty_epucks_wander_for_a_minute_with_few_collisions(seed):
    travel = Travel()
    metrics = run(
        ROOT / "scenarios" / "avoidance.toml", seed=seed, overrides=[f"duration_s={DURATION_S}"], observers=[travel]
    ).metrics
    assert metrics["collisions"].final is not None
    assert metrics["wall_contacts"].final is not None
    assert metrics["collisions"].final <= 3
    assert metrics["wall_contacts"].final <= 3
    share = travel.gone_m / (SPEED_MPS * DURATION_S / 2)  # of the way without an obstacle
    assert share.mean(axis=1).min() > 0.6
    assert share.min() > 0.2
