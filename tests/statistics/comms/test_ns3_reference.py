"""The recorded figures of ns-3 are whole, and rise and fall as figures of contention and reach must."""

import json
from itertools import groupby, pairwise
from math import comb, exp, hypot, log10
from pathlib import Path
from typing import Any

import pytest

FILES = sorted((Path(__file__).parents[2] / "support" / "comms" / "reference").glob("ns3_*.json"))
HEADER = {"simulator", "version", "date", "what", "parameters", "rows"}
WORST_STANDARD_ERROR = 0.005
STANDARD_ERRORS = 3.0  # two figures that differ by less, jointly, may stand in either order


def rows(name: str) -> list[dict[str, Any]]:
    path = Path(__file__).parents[2] / "support" / "comms" / "reference" / f"ns3_{name}.json"
    return json.loads(path.read_text(encoding="utf-8"))["rows"]


def spread(name: str) -> list[list[dict[str, Any]]]:
    """Rows that differ in nodes alone, sending at phases of their own."""
    found = [row for row in rows(name) if row["sending"] == "spread"]
    return [list(group) for _, group in groupby(found, scenario)]


def scenario(row: dict[str, Any]) -> tuple[Any, ...]:
    return row["technology"], row["payload_bytes"], row["interval_s"]


def falls(before: dict[str, Any], after: dict[str, Any], figure: str) -> bool:
    error = hypot(before[f"{figure}_se"], after[f"{figure}_se"])
    return after[figure] <= before[figure] + STANDARD_ERRORS * error


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_file_says_what_was_run_and_every_ratio_is_one_and_well_known(path: Path):
    content = json.loads(path.read_text(encoding="utf-8"))
    assert set(content) >= HEADER
    assert content["rows"]
    for row in content["rows"]:
        assert row["runs"] > 1
        assert row["sent"] > 0
        for name, value in row.items():
            if "_ratio" in name or name.startswith("access_failure_share"):
                assert 0.0 <= value <= 1.0, (row, name)
            if name.endswith("_se") and not name.startswith("mean_delay"):
                assert value < WORST_STANDARD_ERROR, (row, name)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_no_scenario_is_told_twice(path: Path):
    given = ("technology", "sending", "powers", "nodes", "payload_bytes", "interval_s", "distance_m")
    found = [tuple(row.get(name) for name in given) for row in json.loads(path.read_text(encoding="utf-8"))["rows"]]
    assert len(set(found)) == len(found)


@pytest.mark.parametrize("name", ["802154_contention", "80211_contention"])
def test_more_nodes_deliver_less_and_wait_longer(name: str):
    for group in spread(name):
        assert [row["nodes"] for row in group] == sorted(row["nodes"] for row in group)
        for fewer, more in pairwise(group):
            assert falls(fewer, more, "delivery_ratio"), more
            if not fewer.get("queue_bound"):
                assert more["mean_delay_s"] >= fewer["mean_delay_s"] - STANDARD_ERRORS * hypot(
                    more["mean_delay_se_s"], fewer["mean_delay_se_s"]
                ), more


def test_no_frame_arrives_before_its_airtime():
    """802.15.4: sense 128 us, turn around 192 us, 32 us an octet. 802.11: DIFS and the frame at its rate."""
    for row in rows("802154_contention"):
        assert row["mean_delay_s"] > 128e-6 + 192e-6 + 32e-6 * (6 + row["psdu_bytes"])
    shortest_s = {"802.11a 6 Mbit/s": 34e-6 + 244e-6, "802.11b 1 Mbit/s": 50e-6 + 1504e-6}
    for row in rows("80211_contention"):
        assert row["mean_delay_s"] is None or row["mean_delay_s"] >= shortest_s[row["technology"]] - 1e-6


def test_all_at_the_tick_is_worse_than_each_at_its_phase():
    for name in ("802154_contention", "80211_contention"):
        phases = {(row["nodes"], *scenario(row)): row for row in rows(name) if row["sending"] == "spread"}
        ticks = [row for row in rows(name) if row["sending"] == "tick"]
        assert ticks
        for tick in ticks:
            assert tick["delivery_ratio"] < phases[tick["nodes"], *scenario(tick)]["delivery_ratio"]


def test_delivery_falls_with_distance_as_the_bit_errors_of_the_standard_say():
    """IEEE 802.15.4-2006, E.4.1.7, over 37 octets at -106.987 dBm of noise, within four standard errors."""
    for row in rows("802154_distance"):
        sinr_db = -46.6777 - 30.0 * log10(row["distance_m"]) + 106.987
        sinr = 10.0 ** (sinr_db / 10.0)
        ber = (8 / 15) / 16 * sum((-1) ** k * comb(16, k) * exp(20.0 * sinr * (1 / k - 1)) for k in range(2, 17))
        expected = (1.0 - ber) ** (8 * 37)
        binomial_se = (expected * (1.0 - expected) / row["sent"]) ** 0.5
        assert row["delivery_ratio"] == pytest.approx(expected, abs=4.0 * binomial_se + 5e-5), row
    for nearer, farther in pairwise(rows("802154_distance")):
        assert farther["distance_m"] > nearer["distance_m"]
        assert farther["delivery_ratio"] <= nearer["delivery_ratio"]


def test_hidden_senders_lose_more_the_more_they_send():
    def pair(row: dict[str, Any]) -> tuple[Any, ...]:
        return row["technology"], row["powers"], row["payload_bytes"]

    for _, group in groupby(rows("hidden_node"), pair):
        for slower, faster in pairwise(group):
            assert slower["interval_s"] > faster["interval_s"]
            assert falls(slower, faster, "delivery_ratio"), faster


def test_full_queues_collide_as_often_as_saturated_contention_theory_says():
    """Each sends in a slot with 2 / (W + 1), alone with (1 - that)^(n - 1); few nodes, as freezing is left out."""
    windows = {"802.11a 6 Mbit/s": 16, "802.11b 1 Mbit/s": 32}
    full = [row for row in rows("80211_contention") if row["queue_bound"] and row["nodes"] <= 5]
    assert {row["technology"] for row in full} == set(windows)
    for row in full:
        alone = (1.0 - 2.0 / (windows[row["technology"]] + 1)) ** (row["nodes"] - 1)
        assert row["on_air_delivery_ratio"] == pytest.approx(alone, abs=0.02), row
