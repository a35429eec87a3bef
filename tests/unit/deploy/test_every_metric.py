"""Every metric that there is, in one run: what it says of an arena does not depend on those beside it."""

import json

from swarmwire.deploy import run
from swarmwire.metrics.registry import METRICS, standard
from tests.support.deploy.commands import LOSSY

NAMES = sorted(METRICS.keys() - set(standard()))
SETTING = [
    "duration_s=6",
    f"metrics={json.dumps(NAMES)}",
    'arena.lights=[{intensity=4.6, count=1, place="random"}]',
    'events=[{at_s=2.0, do="kill", robots={group="flock", share=0.3}, for_s=2.0}]',
]


def test_it_is_the_same_alone_and_beside_other_arenas():
    alone = run(LOSSY, seeds=[2], overrides=SETTING).arenas[0].metrics
    assert alone.keys() == METRICS.keys()
    beside = run(LOSSY, seeds=[5, 2, 3], overrides=SETTING).arenas[1].metrics
    assert beside == alone
    # What has no value is the same everywhere: nobody tells a number here, and some things do not happen.
    assert sum(found.mean is not None for found in alone.values()) > 0.7 * len(METRICS)
