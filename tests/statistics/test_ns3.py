"""Agreement with ns-3."""

import json
from collections.abc import Mapping
from itertools import groupby, pairwise
from math import comb, exp, hypot, log10
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks import ns3_agreement, ns3_distance, ns3_hidden_node
from benchmarks.ns3_agreement import DELAY_LIMIT, RATIO_LIMIT, Contention, Ours, Scenario, agrees, table
from benchmarks.ns3_distance import LIMIT, Point
from benchmarks.ns3_hidden_node import STEPS, A, B, Case, cases, delivered, schedule
from benchmarks.ns3_hidden_node import agrees as hidden_node_agrees
from benchmarks.ns3_reference import recorded
from swarmwire.comms.draws import derive_key

ROW = Scenario("802.15.4", 20, 20, 0.1, 0.9, 0.004, compares_delay=True)
CASES = cases()
BUSIEST = 0.011  # intervals of 802.15.4 up to here, in s: where hidden senders lose most
QUICK = [
    case
    for case in CASES
    if (case.technology == "802.15.4" and case.interval_s < BUSIEST)
    or (case.technology != "802.15.4" and case.interval_s in (0.01, 0.002))
]
FILES = sorted((Path(__file__).parents[1] / "support" / "comms" / "reference").glob("ns3_*.json"))
HEADER = {"simulator", "version", "date", "what", "parameters", "rows"}
WORST_STANDARD_ERROR = 0.005
STANDARD_ERRORS = 3.0  # two figures that differ by less, jointly, may stand in either order


def off_by(ratio: float, relative_delay: float) -> Contention:
    """a medium that misses every scenario by so much."""
    recorded = {
        (row.technology, row.nodes, row.payload_bytes, row.interval_s): row for row in ns3_agreement.scenarios()
    }

    def contention(
        *, technology: str, nodes: int, payload_bytes: int, interval_s: float, seed: int
    ) -> Mapping[str, float | None]:
        row = recorded[technology, nodes, payload_bytes, interval_s]
        delay_s = None if row.mean_delay_s is None else row.mean_delay_s * (1.0 + relative_delay)
        return {"delivery_ratio": row.delivery_ratio - ratio, "mean_delay_s": delay_s}

    return contention


@pytest.mark.parametrize(
    ("ratio", "delay_s", "verdict"),
    [
        (0.9, 0.004, True),
        (0.9 - 0.9 * RATIO_LIMIT, 0.004, True),
        (0.9 + 1.1 * RATIO_LIMIT, 0.004, False),
        (0.9, 0.004 * (1.0 - 1.1 * DELAY_LIMIT), False),
        (0.9, None, False),
    ],
)
def test_both_figures_must_lie_within_the_limits(ratio: float, delay_s: float | None, verdict: bool):
    assert agrees(ROW, Ours(ratio, delay_s)) is verdict


def test_the_delay_of_a_full_queue_is_not_compared():
    full = Scenario("802.11b 1 Mbit/s", 80, 128, 0.1, 0.5, 0.49, compares_delay=False)
    assert agrees(full, Ours(0.5, 0.02))


def test_the_table_has_a_line_for_each_scenario_and_a_verdict_only_if_there_is_something_to_judge():
    lines = 2 + len(ns3_agreement.scenarios())
    verdicts = {
        "exact": [line.endswith(" yes |") for line in table(off_by(0.0, 0.0), [1, 2])],
        "off": [line.endswith(" **no** |") for line in table(off_by(0.04, 0.0), [1])],
    }
    assert {name: len(found) for name, found in verdicts.items()} == dict.fromkeys(verdicts, lines)
    assert {name: sum(found) for name, found in verdicts.items()} == {"exact": lines - 2, "off": lines - 2}


def test_the_exit_status_tells_whether_all_agree(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    def answers(contention: Contention) -> int:
        monkeypatch.setattr(ns3_agreement.importlib, "import_module", lambda _: SimpleNamespace(ours=contention))
        return ns3_agreement.main(["contention", "--ours", "some.module:ours", "--runs", "1"])

    assert answers(off_by(0.0, 0.0)) == 0
    assert answers(off_by(0.0, 0.2)) == 1
    assert "ns-3: delivered" in capsys.readouterr().out


def title(case: Case) -> str:
    return f"{case.technology}, {case.powers}, {case.payload_bytes} bytes every {case.interval_s:g} s"


@pytest.mark.parametrize("case", QUICK, ids=title)
def test_hidden_senders_lose_what_they_lose_in_ns3(case: Case):
    """4,000 packets of each sender: standard errors of 0.008 at most, so that 0.03 are 3.8 (false alarm 1 in 7,000)."""
    ours = delivered(case, seeds=range(80), packets=50)
    assert hidden_node_agrees(case, ours), ours


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=title)
def test_hidden_senders_lose_what_they_lose_in_ns3_over_long_runs(case: Case):
    """30,000 packets of each sender: standard errors of 0.003 at most, so that only what is off by itself is."""
    ours = delivered(case, seeds=range(300), packets=100)
    assert hidden_node_agrees(case, ours), ours


def test_senders_that_hear_each_other_lose_far_less(monkeypatch: pytest.MonkeyPatch):
    """Else the case would not be one of hidden nodes."""
    (case,) = [one for one in QUICK if (one.powers, one.payload_bytes) == ("equal", 89)]
    monkeypatch.setattr(ns3_hidden_node, "APART_DB", 0.0)
    a, b = delivered(case, seeds=range(20), packets=50)
    assert min(a, b) > max(case.delivery_a, case.delivery_b) + 0.2


def test_every_sender_hands_over_one_packet_in_each_of_its_intervals():
    ticks = schedule(np.array([derive_key("schedule", seed) for seed in range(10)], np.uint64), 30)
    for row in (A, B, 3 * 9 + B):
        at = [tick for tick, rows in enumerate(ticks) if row in rows]
        assert len(at) == 30
        assert all(0 < after - before < 2 * STEPS for before, after in pairwise(at))
        assert len({after - before for before, after in pairwise(at)}) > 10


def test_delivery_over_distance_is_that_of_the_formula_and_of_ns3():
    """4,000 packets each: standard errors of 0.008 at most, so that 0.02 are 2.5 at the two worst (1 in 80 each)."""
    found = list(ns3_distance.points(seeds=range(20), packets=200))
    assert [point.distance_m for point in found] == [row["distance_m"] for row in recorded(ns3_distance.FILE)["rows"]]
    assert [point for point in found if not point.agrees] == []


@pytest.mark.slow
def test_delivery_over_distance_is_that_of_the_formula_over_long_runs():
    """100,000 packets each: standard errors of 0.0016 at most, so that 0.007 are 4.4 (1 in 90,000)."""
    for point in ns3_distance.points(seeds=range(50), packets=2000):
        assert point.ours == pytest.approx(point.formula, abs=0.007)
        assert point.ours == pytest.approx(point.ns3, abs=0.02)


@pytest.mark.parametrize(("off", "verdict"), [(0.99 * LIMIT, True), (-1.01 * LIMIT, False), (1.01 * LIMIT, False)])
def test_a_row_off_the_limit_is_not_one_that_agrees(off: float, verdict: bool):
    assert Point(100.0, 0.5, 0.5 + 0.4 * off, 0.5 + off).agrees is verdict
    case = CASES[0]
    wide = off / LIMIT * ns3_hidden_node.LIMIT
    assert hidden_node_agrees(case, (case.delivery_a, case.delivery_b + wide)) is verdict
    assert hidden_node_agrees(case, (case.delivery_a + wide, case.delivery_b)) is verdict


def rows(name: str) -> list[dict[str, Any]]:
    path = Path(__file__).parents[1] / "support" / "comms" / "reference" / f"ns3_{name}.json"
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
