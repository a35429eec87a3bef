"""Runs of a few robots whose truth tests turn into logs."""

from functools import cache
from pathlib import Path

from swarmwire.deploy import run
from tests.support.deploy.commands import LOSSY
from tests.support.metrics.real_log.as_logs import Watched

SMALL = ("duration_s=20", "robots.flock.count=6", "arena.size_m=[6.0, 6.0]", "arena.obstacles=[]")
METRICS = 'metrics=["speed", "cohesion", "link_pdr", "latency_air"]'


def watched(*overrides: str, seed: int = 1, out: Path | None = None) -> Watched:
    """All truths of a run."""
    of = Watched()
    run(LOSSY, overrides=[*SMALL, METRICS, *overrides], seed=seed, out=out, observers=[of])
    return of


@cache
def flock() -> Watched:
    """The same run for all tests: everybody is in range."""
    return watched("radio.range_m=20")
