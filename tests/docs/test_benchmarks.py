"""What benchmarks print, and what they make up to measure."""

import numpy as np
import pytest

from benchmarks.held_positions import edge_of, received
from benchmarks.relay import delivery
from benchmarks.report_cost import write_campaign
from benchmarks.table import rows
from benchmarks.targets import TARGETS, Target, most
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.metrics.records.campaign.folder import CampaignFolder


def test_benchmark_target_is_met_at_or_beyond_its_bound():
    assert Target(3, "at least").met_by(3.0)
    assert not Target(3, "at least").met_by(2.9)
    assert most(3, "at most").met_by(3.0)
    assert not most(3, "at most").met_by(3.1)


def test_benchmark_row_shows_target_value_and_whether_it_is_met():
    line = {"name": "wire-1000x2", "value": 264_123.4, "unit": "robot-steps/s", "lowest": 241_000, "highest": 275_000}
    slow = {**line, "value": 12_345.6, "engine": "pymunk"}
    _, row = rows([{**line, "value": 1.0}, line, slow])
    least = TARGETS["wire-1000x2"].value
    assert row[1:5] == (f"≥ {least:,}", "264,000 robot-steps/s (241,000 to 275,000)", "met", "12,300")
    assert "missed" in rows([{**line, "value": 100}])[1]


def test_benchmark_campaign_is_complete_and_readable(tmp_path):
    assert write_campaign(tmp_path, 20) == 1000
    campaign = CampaignFolder(tmp_path)
    assert (campaign.finished, len(campaign.points), len(campaign.responses)) == (True, 50, 10)
    assert campaign.sample("stop_time_s", 45).censored > 0.0


def test_benchmark_of_relayed_maps_has_the_loss_to_the_power_of_the_parts():
    """Over the medium, with its collisions: about one broadcast of 300 by the table in docs/ros2-radio.md."""
    best_effort, reliable = (delivery(0.3, reliable=reliable, sending_s=10) for reliable in (False, True))
    assert best_effort.parts == 3
    assert best_effort.delivered == pytest.approx(0.7**3, abs=4 * (0.7**3 * (1 - 0.7**3) / 900) ** 0.5)
    assert reliable.delivered > 0.99


@pytest.mark.parametrize(("rate_hz", "arrives"), [(10, [True, False]), (1000, [False, True])])
def test_packet_is_received_by_positions_at_the_start_of_its_tick(rate_hz: int, arrives: list[bool]):
    """One pair leaves the range half a metre before the packet is sent, another one enters it."""
    start_m, speeds_mps = np.array([49.9, 50.1]), np.array([10.0, -10.0])
    packets = received(Radio(range_m=50.0), start_m, np.full((2, 1), 0.05), speeds_mps, rate_hz)
    assert packets[:, 0].tolist() == arrives


def test_disk_radio_has_its_edge_at_its_range():
    assert edge_of(Radio(range_m=50.0)) == pytest.approx((50.0, 50.0, 50.0), abs=0.02)
