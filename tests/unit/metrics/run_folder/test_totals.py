"""The tables that are totals: written as the run ends, read back, and compared with the summary."""

import json
import re

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.errors import BadInput, RecordFailed
from swarmwire.comms.packets import Fate
from swarmwire.metrics.network.latency import RadioTally
from swarmwire.metrics.run_folder import distances
from swarmwire.metrics.run_folder.distances import DistanceRecorder
from swarmwire.metrics.run_folder.radio_totals import RobotRecorder
from swarmwire.metrics.run_folder.reader import RunFolder
from swarmwire.metrics.run_folder.table import State
from swarmwire.metrics.run_folder.verify import verify
from tests.support.metrics.radio import DISK, ticks
from tests.support.metrics.recorded import links, made_up_summary, record
from tests.support.metrics.truths import departed, static, truth, watch

TOTALS = ("radio_robots", "radio_distances", "radio_links")
OF = static(5, arenas=2)


@pytest.fixture
def folder(tmp_path):
    """A run folder as far as the radio goes, with its summary."""
    seen = list(ticks(DISK, OF, 7, count=20))
    recorded, tally = record(tmp_path, OF, seen, links=True), RadioTally()
    watch(OF, seen, tally)
    summary = made_up_summary(20, arenas=2, record=recorded, **tally.end(None))
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    return RunFolder(tmp_path)


def states(folder):
    return {finding.part: finding.state for finding in verify(folder.path) if finding.part in TOTALS}


def test_the_tables_of_a_run_agree_with_its_summary_and_with_one_another(folder):
    assert states(folder) == dict.fromkeys(TOTALS, State.INTACT)
    for arena, radio in enumerate(folder.summary["radio"]):
        robots, reached = folder.radio_robots(arena), folder.radio_links(arena)
        assert robots["robot"].to_list() == list(OF.robot_names)
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
def test_a_table_that_does_not_agree_with_the_summary_is_named(folder, table, columns):
    file = folder.path / f"{table}.parquet"
    pl.read_parquet(file).with_columns(pl.col(columns) * 2).write_parquet(file)
    assert states(folder) == {**dict.fromkeys(TOTALS, State.INTACT), table: State.DIFFERS}
    file.unlink()
    assert states(folder)[table] == State.MISSING


@pytest.mark.parametrize(
    ("table", "change", "state", "text"),
    [
        ("radio_distances", pl.lit(7.0).alias("pdr"), State.DAMAGED, r"pdr .*received / intended"),
        ("radio_distances", pl.col("pdr").cast(pl.String), State.DAMAGED, "pdr .*String.*Float64"),
        ("radio_distances", pl.lit(None, pl.Float64).alias("from_m"), State.DAMAGED, "from_m .*null"),
        ("radio_robots", pl.col("robot").reverse(), State.DAMAGED, r"flock-4 \(arena 0\)"),
        ("radio_robots", pl.lit(0, pl.Int64).alias("as_receiver_received"), State.DIFFERS, "0 received"),
        ("radio_robots", pl.lit(-1, pl.Int64).alias("packets"), State.DAMAGED, "packets .*10 rows"),
        ("radio_links", pl.lit(99, pl.Int32).alias("sender"), State.DAMAGED, "sender .*4"),
        ("radio_links", pl.lit(2, pl.Int32).alias("arena"), State.DAMAGED, "arena .*1"),
    ],
)
def test_what_cannot_be_in_a_table_is_named(folder, table, change, state, text):
    file = folder.path / f"{table}.parquet"
    pl.read_parquet(file).with_columns(change).write_parquet(file)
    assert states(folder) == {**dict.fromkeys(TOTALS, State.INTACT), table: state}
    (found,) = (finding for finding in verify(folder.path) if finding.part == table)
    assert re.match(text, found.text)


def test_without_static_json_tables_are_checked_as_far_as_they_go(folder):
    (folder.path / "static.json").unlink()
    assert states(folder) == dict.fromkeys(TOTALS, State.INTACT)
    file = folder.path / "radio_links.parquet"
    pl.read_parquet(file).with_columns(pl.col("packets").cast(pl.Float64)).write_parquet(file)
    assert states(folder)["radio_links"] == State.DAMAGED


def test_the_ratio_is_received_over_intended_in_bins_side_by_side(folder):
    table = folder.radio_distances(1)
    assert table["from_m"][0] == 0.0
    np.testing.assert_allclose(table["from_m"][1:], table["to_m"][:-1])
    some = table.filter(pl.col("intended") > 0)
    np.testing.assert_allclose(some["pdr"], some["received"] / some["intended"])
    assert table.filter(pl.col("intended") == 0)["pdr"].null_count() == len(table) - len(some) > 0


def test_where_distances_were_forgotten_there_is_no_ratio(tmp_path, monkeypatch):
    monkeypatch.setattr(distances, "POSES_KEPT_S", 0.1)
    of = static(2)
    nothing = links([], [], 0, 0)
    seen = [truth(of, tick, departed=departed([0] if tick == 1 else []), finished=nothing) for tick in range(4)]
    seen.append(truth(of, 4, departed=departed([]), finished=links([0], [1], 0, 0)))
    told = record(tmp_path, of, seen)
    assert told["radio_distances"] == {"rows": 1, "dropped": 0, "every": 1, "unknown": 1}
    assert RunFolder(tmp_path).radio_distances().rows() == [(0, 0.0, 0.1, 1, 0, None)]


def test_links_are_off_unless_asked_for_and_without_a_radio_there_is_no_table(tmp_path):
    of = static(2)
    quiet = truth(of, departed=departed([]), finished=links([], [], 0, 0))
    (tmp_path / "radio").mkdir()
    (tmp_path / "none").mkdir()
    assert record(tmp_path / "radio", of, [quiet]).keys() == {"ticks", "events", "radio_robots", "radio_distances"}
    assert record(tmp_path / "none", of, [truth(of)], links=True).keys() == {"ticks", "events"}
    for table, missing in (("radio_links", "radio"), ("radio_robots", "none")):
        with pytest.raises(BadInput, check=lambda error, table=table: error.key == table):
            getattr(RunFolder(tmp_path / missing), table)()
    assert len(RunFolder(tmp_path / "radio").radio_distances()) == 0


@pytest.mark.parametrize("kind", [RobotRecorder, DistanceRecorder])
def test_a_disk_that_refuses_is_told_of(tmp_path, kind):
    of, recorder = static(2), kind(tmp_path / "gone")
    recorder.begin(of)
    recorder.see(truth(of, departed=departed([0]), finished=links([], [], 0, 0)))
    with pytest.raises(RecordFailed, match="radio_"):
        recorder.end(None)
