"""The table of agreement with ns-3 says yes where figures lie within the limits, and only there."""

from collections.abc import Mapping
from types import SimpleNamespace

import pytest

from benchmarks import ns3_agreement
from benchmarks.ns3_agreement import DELAY_LIMIT, RATIO_LIMIT, Contention, Ours, Scenario, agrees, table

ROW = Scenario("802.15.4", 20, 20, 0.1, 0.9, 0.004, compares_delay=True)


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
