"""Every shipped scenario tells its story in its summary."""

import numpy as np
import pytest

from swarmwire.deploy import Result, run
from swarmwire.deploy.result import ArenaResult
from tests.deploy.commands import ROOT

SCENARIOS = ROOT / "scenarios"


def final(arena: Result | ArenaResult, metric: str) -> float:
    value = arena.metrics[metric].final
    assert value is not None
    return value
