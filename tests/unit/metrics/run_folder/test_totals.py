"""The tables that are totals: written as the run ends, read back, and compared with sums by hand and by brute force."""

import json
import math
import re
from collections import Counter
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings

from swarmwire.comms.base.errors import BadInput, RecordFailed
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.packets import Fate
from swarmwire.metrics.measures.network.latency import RadioTally
from swarmwire.metrics.records.run_folder import distances
from swarmwire.metrics.records.run_folder.distances import DistanceCounts, bin_width_m
from swarmwire.metrics.records.run_folder.radio_totals import RobotCounts
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.records.run_folder.table import TableState, TotalsRecorder
from swarmwire.metrics.records.run_folder.verify import verify
from tests.support.metrics.radio import DISK, radio_runs, rows_of, ticks
from tests.support.metrics.recorded import links, made_up_summary, record
from tests.support.metrics.truths import departed, static, truth, watch

TOTALS = ("radio_robots", "radio_distances", "radio_links")
RUN = static(5, arenas=2)


@pytest.fixture
def folder(tmp_path):
    """A run folder as far as the radio goes, with its summary."""
    truths = list(ticks(DISK, RUN, 7, count=20))
    recorded, tally = record(tmp_path, RUN, truths, links=True), RadioTally()
    watch(RUN, truths, tally)
    summary = made_up_summary(20, arenas=2, record=recorded, **tally.end(None))
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    return RunFolder(tmp_path)


def states(folder):
    return {finding.part: finding.state for finding in verify(folder.path) if finding.part in TOTALS}


def test_radio_totals_agree_with_the_summary_and_with_one_another(folder):
    assert states(folder) == dict.fromkeys(TOTALS, TableState.INTACT)
    for arena, radio in enumerate(folder.summary["radio"]):
        robots, reached = folder.radio_robots(arena), folder.radio_links(arena)
        assert robots["robot"].to_list() == list(RUN.robot_names)
        for name in ("received", "blocked", "lost"):
            assert robots[f"as_sender_{name}"].sum() == robots[f"as_receiver_{name}"].sum() == radio["fates"][name]
            assert reached.filter(pl.col("fate") == name)["packets"].sum() == radio["fates"][name]
        assert robots["as_sender_out_of_range"].sum() == radio["fates"]["out_of_range"]
        as_sender = robots.select(pl.sum_horizontal(f"as_sender_{fate.name.lower()}" for fate in Fate)).to_series()
        assert as_sender.to_list() == robots["intended"].to_list()
        assert folder.radio_distances(arena)["received"].sum() == radio["fates"]["received"]
        np.testing.assert_allclose(robots["throughput_bps"], robots["received_bytes"] * 8 / 2.0)
        np.testing.assert_allclose(robots["airtime"], robots["airtime_s"] / 2.0)
    assert (len(folder.radio_robots()), folder.radio_robots()["packets_on_air"].min() > 0) == (10, True)


@pytest.mark.parametrize(
    ("table", "columns"),
    [
        ("radio_robots", ["as_sender_lost", "as_receiver_lost"]),
        ("radio_links", ["packets"]),
        ("radio_distances", ["received", "intended"]),
    ],
)
def test_radio_totals_that_disagree_with_the_summary_are_named(folder, table, columns):
    file = folder.path / f"{table}.parquet"
    pl.read_parquet(file).with_columns(pl.col(columns) * 2).write_parquet(file)
    assert states(folder) == {**dict.fromkeys(TOTALS, TableState.INTACT), table: TableState.DIFFERS}
    file.unlink()
    assert states(folder)[table] == TableState.MISSING


@pytest.mark.parametrize(
    ("table", "change", "state", "text"),
    [
        ("radio_distances", pl.lit(7.0).alias("pdr"), TableState.DAMAGED, r"pdr .*received / intended"),
        ("radio_distances", pl.col("pdr").cast(pl.String), TableState.DAMAGED, "pdr .*String.*Float64"),
        ("radio_distances", pl.lit(None, pl.Float64).alias("from_m"), TableState.DAMAGED, "from_m .*null"),
        ("radio_robots", pl.col("robot").reverse(), TableState.DAMAGED, r"flock-4 \(arena 0\)"),
        ("radio_robots", pl.lit(0, pl.Int64).alias("as_receiver_received"), TableState.DIFFERS, "0 received"),
        ("radio_robots", pl.lit(-1, pl.Int64).alias("packets"), TableState.DAMAGED, "packets .*10 rows"),
        ("radio_links", pl.lit(99, pl.Int32).alias("sender"), TableState.DAMAGED, "sender .*4"),
        ("radio_links", pl.lit(2, pl.Int32).alias("arena"), TableState.DAMAGED, "arena .*1"),
    ],
)
def test_radio_totals_that_are_damaged_are_found_with_their_fault(folder, table, change, state, text):
    file = folder.path / f"{table}.parquet"
    pl.read_parquet(file).with_columns(change).write_parquet(file)
    assert states(folder) == {**dict.fromkeys(TOTALS, TableState.INTACT), table: state}
    (finding,) = (row for row in verify(folder.path) if row.part == table)
    assert re.search(text, finding.text)


def test_without_static_json_tables_are_checked_as_far_as_they_go(folder):
    (folder.path / "static.json").unlink()
    assert states(folder) == dict.fromkeys(TOTALS, TableState.INTACT)
    file = folder.path / "radio_links.parquet"
    pl.read_parquet(file).with_columns(pl.col("packets").cast(pl.Float64)).write_parquet(file)
    assert states(folder)["radio_links"] == TableState.DAMAGED


def test_distance_ratio_is_received_over_intended_in_adjacent_bins(folder):
    table = folder.radio_distances(1)
    assert table["from_m"][0] == 0.0
    np.testing.assert_allclose(table["from_m"][1:], table["to_m"][:-1])
    some = table.filter(pl.col("intended") > 0)
    np.testing.assert_allclose(some["pdr"], some["received"] / some["intended"])
    assert table.filter(pl.col("intended") == 0)["pdr"].null_count() == len(table) - len(some) > 0


def test_distance_ratio_is_null_where_distances_were_forgotten(tmp_path, monkeypatch):
    monkeypatch.setattr(distances, "POSES_S", 0.1)
    run = static(2)
    nothing = links([], [], 0, 0)
    truths = [truth(run, tick, departed=departed([0] if tick == 1 else []), finished=nothing) for tick in range(4)]
    truths.append(truth(run, 4, departed=departed([]), finished=links([0], [1], 0, 0)))
    recorded = record(tmp_path, run, truths)
    assert recorded["radio_distances"] == {"rows": 1, "dropped": 0, "every": 1, "unknown": 1}
    assert RunFolder(tmp_path).radio_distances().rows() == [(0, 0.0, 0.1, 1, 0, None)]


def test_links_are_off_unless_asked_for_and_without_a_radio_there_is_no_table(tmp_path):
    run = static(2)
    quiet = truth(run, departed=departed([]), finished=links([], [], 0, 0))
    (tmp_path / "radio").mkdir()
    (tmp_path / "none").mkdir()
    assert record(tmp_path / "radio", run, [quiet]).keys() == {"ticks", "events", "radio_robots", "radio_distances"}
    assert record(tmp_path / "none", run, [truth(run)], links=True).keys() == {"ticks", "events"}
    for table, missing in (("radio_links", "radio"), ("radio_robots", "none")):
        with pytest.raises(BadInput, check=lambda error, table=table: error.key == table):
            getattr(RunFolder(tmp_path / missing), table)()
    assert len(RunFolder(tmp_path / "radio").radio_distances()) == 0


@pytest.mark.parametrize("kind", [RobotCounts, DistanceCounts])
def test_disk_that_refuses_a_total_fails_the_record(tmp_path, kind):
    run, recorder = static(2), TotalsRecorder(tmp_path / "gone", "radio_robots", kind)
    recorder.begin(run)
    recorder.see(truth(run, departed=departed([0]), finished=links([], [], 0, 0)))
    with pytest.raises(RecordFailed, match="radio_"):
        recorder.end(None)


def seen_by(run, *ticks):
    counts = DistanceCounts(run)
    for tick, fields in enumerate(ticks):
        counts.see(truth(run, tick, **fields))
    return counts


@pytest.mark.parametrize(("range_m", "width_m"), [(2.0, 0.1), (3.9, 0.1), (4.0, 0.2), (100.0, 5.0), (0.05, 0.002)])
def test_bins_have_a_round_width_and_at_least_twenty_lie_within_range(range_m, width_m):
    assert bin_width_m(range_m) == pytest.approx(width_m)


@pytest.mark.parametrize("range_m", [5e-324, 1e-300, 1e-7, 0.2, 2.0, None, 1e300])
def test_however_short_the_range_the_bins_reach_across_the_arena_and_are_few(range_m):
    counts = DistanceCounts(replace(static(2), range_m=range_m))
    across_m = math.hypot(8.0, 6.0)
    assert across_m < counts.intended.shape[1] * counts.width_m < 1.2 * across_m
    assert 20 <= counts.intended.shape[1] <= 2002


def test_distance_counts_are_by_the_distance_in_space():
    run = replace(static(2), arena_size_m=(40.0, 40.0), range_m=30.0)
    pose, height_m = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]]), np.array([0.0, 12.0])
    counts = seen_by(
        run, {"pose": pose, "height_m": height_m, "departed": departed([0]), "finished": links([0], [1], 0, 0)}
    )
    assert np.flatnonzero(counts.intended[0]).tolist() == [int(13.0 / counts.width_m)]
    assert np.array_equal(counts.intended, counts.received)


def test_distance_counts_leave_out_packets_that_never_went_on_air():
    refused = departed([0], fate=Fate.QUEUE_FULL)
    fields = {"departed": refused, "finished": links([0], [-1], 0, 0, fate=Fate.QUEUE_FULL, receivers=3)}
    assert not seen_by(static(4), fields).intended.any()


def test_distance_counts_of_packets_on_air_for_too_long_are_unknown_also_if_all_are_lost(monkeypatch):
    monkeypatch.setattr(distances, "POSES_S", 0.2)
    nothing = {"departed": departed([]), "finished": links([], [], 0, 0)}
    late = {**nothing, "finished": links([0], [1], 0, 0)}
    lost = {"departed": departed([0], intended=2), "finished": links([0], [1], 0, 0, fate=Fate.LOST)}
    for last, unknown in ((late, 1), (lost, 2)):
        assert [seen_by(static(3), *[nothing] * ticks, last).unknown for ticks in (2, 3)] == [0, unknown]


@pytest.mark.parametrize("pairs_per_tick", [10**6, 10, 3])
@settings(max_examples=15)
@given(run=radio_runs())
def test_distance_counts_are_those_of_a_loop_over_packets_and_robots(pairs_per_tick, run):
    run, truths = run
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(distances, "PAIRS_PER_TICK", pairs_per_tick)
        counts = DistanceCounts(run)
    spread = int(distances.SEQUENCE_MULTIPLIER), int(distances.SENDER_MULTIPLIER)
    intended, received = Counter(), Counter()

    def distance_bin(arena, a, b, on_air_at_ns):
        tick = max(one.tick for one in truths if one.time_ns <= on_air_at_ns)
        pose = truths[tick].pose.reshape(run.arenas, run.robots, 3)[arena]
        return arena, int(math.dist(pose[a, :2], pose[b, :2]) / counts.width_m)

    def is_counted(sender, sequence):
        return (sequence * spread[0] + sender * spread[1]) % 2**64 * counts.every < 2**64

    for one in truths:
        counts.see(one)
        for arena, sender, to, sequence, fate, on_air in rows_of(
            one.departed, "arena", "sender", "to", "sequence", "fate", "on_air_at_ns"
        ):
            tick = max(one.tick for one in truths if one.time_ns <= on_air)
            alive = truths[tick].alive.reshape(run.arenas, run.robots)[arena]
            for robot in range(run.robots):
                meant = alive[robot] if to == BROADCAST else robot == to
                if meant and robot != sender and fate == Fate.RECEIVED and is_counted(sender, sequence):
                    intended[distance_bin(arena, sender, robot, on_air)] += 1
        for arena, sender, receiver, sequence, fate, on_air in rows_of(
            one.finished, "arena", "sender", "receiver", "sequence", "fate", "on_air_at_ns"
        ):
            if fate == Fate.RECEIVED and is_counted(sender, sequence):
                received[distance_bin(arena, sender, receiver, on_air)] += 1
    last = counts.intended.shape[1] - 1  # beyond the arena's corners, where these robots may walk
    for table, expected in ((counts.intended, intended), (counts.received, received)):
        within = Counter()
        for (arena, b), packets in expected.items():
            within[arena, min(b, last)] += packets
        assert {(a, b): int(table[a, b]) for a, b in zip(*np.nonzero(table), strict=True)} == dict(within)
    assert counts.unknown == 0


def test_distance_counts_of_large_swarms_take_an_even_share_of_packets():
    run = static(1000)
    counts = DistanceCounts(run)
    assert counts.every == 256
    sender, sequence = (one.ravel() for one in np.meshgrid(np.arange(1000), np.arange(600)))
    counted = counts._is_counted(sender, sequence)
    assert counted.mean() == pytest.approx(1 / 256, rel=0.02)
    for period in (2, 3, 4, 16):
        turns = np.bincount(sequence[counted] % period)
        assert turns.min() > 0.9 * turns.max()
    in_tick = np.bincount(sequence[counted], minlength=600)
    assert (in_tick.min() >= 1, in_tick.max() <= 9) == (True, True)
