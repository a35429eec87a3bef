"""Agreement with ns-3: the medium beside ns-3's recorded figures, and ns-3 itself where its wheel is installed."""

import multiprocessing
import re
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from functools import partial
from importlib.util import find_spec
from itertools import groupby, pairwise
from math import comb, exp, hypot, log10
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.ns3 import __main__ as command
from benchmarks.ns3 import comparison
from benchmarks.ns3.closed_forms import GROUPS, closed_forms
from benchmarks.ns3.comparison import (
    DELAY,
    LIMITS,
    REASONS,
    THROUGHPUT,
    Agreement,
    Row,
    figures_of,
    filled,
    recorded,
    standard_error,
    table,
    write_record,
)
from benchmarks.ns3.configurations import Configuration
from benchmarks.ns3.sections import SECTIONS
from benchmarks.ns3.simulators import Received, ours, theirs
from benchmarks.ns3.trace import APART, BY_DISTANCE, NEAR, OVER_TIME, TOGETHER, deliveries, recorded_trace
from benchmarks.ns3.trace import ours as ours_of_trace
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.config.radio import POSITIONS

RECORD = recorded()
CONFIGURATIONS = [c for make in SECTIONS.values() for c in make()]
REQUESTS = "40, 40 m, unicast, A-MPDU"  # block acknowledgements of hidden senders collide
LONE = Configuration("802.15.4", 0.25, 2, 20, 0.01, "line", (110.0,), seeds=3, measured_s=1.0)
STANDARD_ERRORS = 3.0  # two figures that differ by less, jointly, may stand in either order


@pytest.mark.parametrize(
    "c",
    # Full queues of 802.11n are a thousand frames a run and station. Only REQUESTS notices requests that are given up.
    [
        pytest.param(c, marks=pytest.mark.slow)
        if c.standard == "802.11n" and c.is_saturated and REQUESTS not in c.where
        else c
        for c in CONFIGURATIONS
    ],
    ids=lambda c: " ".join(c.cells),
)
def test_medium_matches_the_recorded_figures_of_ns3(c: Configuration):
    """The same places and send times, and fixed keys: a row is off limits always or never."""
    row = Row.compare(c, RECORD[c], figures_of(c, ours(c)))
    assert not row.misses or row.reason is not None, row.misses


@pytest.mark.parametrize("positions", POSITIONS)
def test_delivery_of_a_trace_matches_the_recorded_figures_of_ns3(positions: str):
    ns3, medium = recorded_trace().deliveries, deliveries(ours_of_trace(positions))
    for name, bins in ((OVER_TIME, 60), (NEAR, 60), (BY_DISTANCE, 10)):
        assert ns3[name].shape == (bins,)
        np.testing.assert_allclose(medium[name], ns3[name], atol=LIMITS["delivery"])


def test_delivery_at_the_edge_of_a_trace_is_half_a_tick_late_if_positions_are_held():
    """Pairs there move at 2.4 m/s along their line, on average: in 0.05 s by 0.06 of 2 m."""
    ns3 = recorded_trace().deliveries
    held, interpolated = (deliveries(ours_of_trace(positions)) for positions in ("held", "interpolated"))
    for name, difference in ((APART, 0.06), (TOGETHER, -0.06)):
        assert held[name] - ns3[name] == pytest.approx(difference, abs=0.01)
        assert interpolated[name] == pytest.approx(ns3[name], abs=0.005)


def test_reasons_belong_to_rows():
    titles = [" ".join(c.cells) for c in CONFIGURATIONS]
    assert [key for key in REASONS if not any(re.match(key, title) for title in titles)] == []


def test_record_has_every_configuration_and_a_figure_for_each_seed():
    assert set(RECORD) == set(CONFIGURATIONS)
    for c, figures in RECORD.items():
        for name, values in figures.items():
            assert values.shape == (c.seeds,)
            if name not in (DELAY, THROUGHPUT):
                assert np.nanmin(values) >= 0.0
                assert np.nanmax(values) <= 1.0


@pytest.mark.skipif(find_spec("ns3") is None, reason="ns-3's wheel is not installed: .ci/sync --group validation")
def test_ns3_answers_as_recorded():
    (c,) = [each for each in SECTIONS["distance"]() if (each.standard, each.size_m) == ("802.15.4", (110.0,))]
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        figures = figures_of(c, pool.submit(theirs, c).result())
    for name, values in RECORD[c].items():
        np.testing.assert_allclose(figures[name], values, atol=1e-6)


def test_delivery_over_distance_matches_the_bit_errors_of_the_standard():
    """IEEE 802.15.4-2006, E.4.1.7, over 37 octets at -106.987 dBm of noise, within four standard errors."""
    for c in SECTIONS["distance"]():
        if c.standard == "802.15.4":
            sinr = 10.0 ** (0.1 * (106.987 - 46.6777 - 30.0 * log10(c.size_m[0])))
            ber = (8 / 15) / 16 * sum((-1) ** k * comb(16, k) * exp(20.0 * sinr * (1 / k - 1)) for k in range(2, 17))
            expected, sent = (
                (1.0 - ber) ** (8 * 37),
                c.seeds * c.measured_s * c.rate_hz,
            )
            error = (expected * (1.0 - expected) / sent) ** 0.5
            assert RECORD[c]["delivery"].mean() == pytest.approx(expected, abs=4.0 * error + 5e-5)


def test_delivery_falls_with_the_number_of_nodes_in_one_spot():
    def alike(c: Configuration) -> tuple[object, ...]:
        return c.standard, c.rate_mbps, c.payload_bytes, c.interval_s

    for _, group in groupby(sorted(SECTIONS["spot"](), key=lambda c: (*alike(c), c.nodes)), alike):
        for fewer, more in pairwise([RECORD[c]["delivery"] for c in group]):
            assert more.mean() <= fewer.mean() + STANDARD_ERRORS * hypot(standard_error(more), standard_error(fewer))


@pytest.mark.parametrize("name", LIMITS)
@pytest.mark.parametrize(("share", "verdict"), [(0.99, True), (1.01, False), (-0.99, True), (-1.01, False)])
def test_mean_difference_above_the_limit_is_a_miss(name: str, share: float, verdict: bool):
    ns3 = np.array([0.5, 0.7])
    scale = 1.0 if name == "delivery" else float(ns3.mean())
    row = Row(LONE, [Agreement(name, ns3, ns3 + share * LIMITS[name] * scale)])
    assert row.misses == ([] if verdict else [name])
    assert table([row])[2].endswith("| within |" if verdict else "| **miss** (1) |")


def test_seeds_without_a_figure_are_skipped():
    agreement = Agreement(DELAY, np.array([1.0, np.nan, 3.0]), np.array([1.0, 2.0, np.nan]))
    assert agreement.differences.tolist() == [0.0]
    none = Agreement(DELAY, np.array([np.nan]), np.array([1.0]))
    assert none.is_within
    assert none.cells == ["-", "-"]


def test_standard_errors_are_those_of_means():
    values = np.array([0.1, 0.4, 0.3, np.nan])
    assert standard_error(values) == pytest.approx(np.std([0.1, 0.4, 0.3], ddof=1) / 3**0.5)


def test_ns3_input_has_the_positions_and_send_times_of_the_medium():
    words = LONE.ns3_input(1).split()
    standard, _, manager, _, _, seed, nodes, payload = words[:8]
    assert (standard, manager, seed, nodes, payload) == ("802.15.4", "ConstantRate", "2", "2", "20")
    assert [float(word) for word in words[16:20]] == LONE.xy_m()[1].ravel().tolist()
    sent = np.array(words[20:], np.int64).reshape(-1, 4)
    assert sent[:, 3].tolist() == LONE.sent_at_ns()[:, 1, 0].tolist()
    assert set(sent[:, 2].tolist()) == {-1}


def test_ns3_input_names_a_movement_file():
    words = LONE.ns3_input(1, Path("my walk.tcl"))
    assert words.startswith(" ".join(LONE.ns3_input(1).split()[:13]) + " 0 0.01 ")
    assert words.split('"')[1] == "my walk.tcl"


def test_figures_count_packets_in_the_measured_time_by_sender():
    figures = figures_of(LONE, ours(LONE))
    assert set(figures) == {"delivery", DELAY}
    assert figures["delivery"] * 100 == pytest.approx(np.round(figures["delivery"] * 100))
    hidden = Configuration("802.15.4", 0.25, 3, 20, 0.02, "line", (70.0, 70.0), seeds=2, measured_s=1.0)
    assert set(figures_of(hidden, ours(hidden))) == {"delivery of a", "delivery of b", DELAY}


def test_mixed_rows_count_broadcasts_and_unicast_apart():
    """Of three nodes 0 and 2 send to the next one, and 1 to both others."""
    mixed = Configuration("802.11a", 6.0, 3, 20, 0.1, unicast=True, is_mixed=True, seeds=1, measured_s=1.0)
    counts = np.array([[[0, 10, 3], [5, 0, 2], [8, 3, 0]]])
    figures = figures_of(mixed, Received(counts, 10**6 * counts))
    assert {name: values.tolist() for name, values in figures.items()} == {
        "delivery": [0.35],
        "delivery of unicast": [0.9],
        DELAY: [1.0],
    }


SLOW = (pytest.mark.slow, pytest.mark.timeout(600))


@pytest.mark.parametrize("group", [pytest.param(group, marks=SLOW) if group == "lora" else group for group in GROUPS])
def test_closed_forms_are_met(group: str):
    lines = closed_forms([group])
    assert len(lines) > 2
    assert [line for line in lines if "miss" in line] == []


def test_tables_replace_the_text_between_the_marks_of_a_page(tmp_path: Path):
    page = tmp_path / "page.md"
    page.write_text("a\n<!-- spot -->\nold\n<!-- end of spot -->\nb\n", encoding="utf-8")
    assert filled(page, {"spot": ["new", "line"]}) == "a\n<!-- spot -->\nnew\nline\n<!-- end of spot -->\nb\n"
    with pytest.raises(BadInput, match="<!-- area -->"):
        filled(page, {"area": []})


def test_ns3_command_compares_with_the_record_without_ns3(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(command, "find_spec", lambda _: None)
    assert command.main(["--only", "distance"]) == 2
    assert "validation" in capsys.readouterr().err
    assert command.main(["--only", "distance", "--recorded"]) == 0
    out = capsys.readouterr().out
    assert out.count("| 802.15.4 0.25M |") == len([c for c in SECTIONS["distance"]() if c.standard == "802.15.4"])


def test_ns3_command_interrupted_leaves_no_partial_file_and_stops(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    begun: list[Configuration] = []

    def ns3(c: Configuration) -> Received:
        begun.append(c)
        counts = np.zeros((c.seeds, c.nodes, c.nodes), np.int64)
        return Received(counts, counts)

    def interrupted(file: Path, **_: np.ndarray) -> None:
        file.write_bytes(b"PK")
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "find_spec", lambda _: True)
    monkeypatch.setattr(command, "theirs", ns3)
    monkeypatch.setattr(command, "ProcessPoolExecutor", OneAtATime)
    monkeypatch.setattr(np, "savez_compressed", interrupted)
    with pytest.raises(KeyboardInterrupt):
        command.main(["--only", "distance", "--cache", str(tmp_path)])
    assert list(tmp_path.iterdir()) == []
    assert len(begun) < len(SECTIONS["distance"]())


def test_record_of_a_section_keeps_the_rows_of_others(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    file = tmp_path / "ns3.json"
    file.write_text(comparison.RECORD.read_text(encoding="utf-8"), encoding="utf-8")
    monkeypatch.setattr(comparison, "RECORD", file)
    [unchanged, renewed, removed] = CONFIGURATIONS[:3]
    write_record({renewed: {"delivery": np.zeros(renewed.seeds)}}, [unchanged, renewed, LONE])
    rows = recorded()
    assert set(rows) == {unchanged, renewed}
    assert removed not in rows
    assert rows[renewed]["delivery"].tolist() == [0.0] * renewed.seeds
    np.testing.assert_equal(rows[unchanged], RECORD[unchanged])


class OneAtATime(Executor):
    """A pool that does the first task at once, and the rest at its end unless they are cancelled."""

    def __init__(self, *_: object) -> None:
        self._left: list[tuple[Future[Received], Callable[[], Received]]] = []

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Received] = Future()
        if not self._left:
            future.set_result(fn(*args, **kwargs))
        self._left.append((future, partial(fn, *args, **kwargs)))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        for future, work in self._left:
            if not future.done() and not (cancel_futures and future.cancel()):
                future.set_result(work())


def test_ns3_command_refuses_to_record_fewer_seeds(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        command.main(["--record", "--quick"])
    assert "--record" in capsys.readouterr().err
