"""Runs in this process whose robots are spread over several runners: every frame is encoded and decoded."""

from functools import partial
from pathlib import Path
from typing import Any

import pytest

from swarmwire.deploy import Result, backends, run
from tests.support.encoded_backend import EncodedBackend

PER_ROBOT = 1000  # more runners than robots


def run_spread(scenario: Path, runners: int | None, **given: Any) -> Result:
    """A run with its robots in so many parts; None: agents get what they sense as it is."""
    with pytest.MonkeyPatch.context() as patched:
        if runners is not None:
            patched.setattr(backends, "LocalBackend", partial(EncodedBackend, runners=runners))
        return run(scenario, **given)
