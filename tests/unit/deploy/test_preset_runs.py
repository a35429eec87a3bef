"""Every preset is the radio of a run, in which all packets are accounted for."""

import pytest

from swarmwire.comms.radio.config.presets import PRESETS
from swarmwire.deploy import run
from tests.support.deploy.commands import ROOT

SCENARIO = ROOT / "scenarios" / "flocking-802154.toml"


@pytest.mark.parametrize("preset", PRESETS)
def test_a_flock_runs_over_every_preset(preset: str):
    radio = f'radio={{preset="{preset}",measures={{range={{}},bearing={{}}}},max_payload_bytes=6}}'
    result = run(SCENARIO, overrides=["duration_s=1", "robots.flock.count=5", radio])
    assert result.radio is not None
    assert result.radio.sent > 40
    assert sum(result.radio.fates.values()) == result.radio.intended == 4 * result.radio.sent
