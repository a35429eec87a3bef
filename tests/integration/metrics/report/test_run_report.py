"""The report of a single run tells what its folder holds, whatever is missing."""

import json
from dataclasses import asdict, replace

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.truth import EventRecord
from swarmwire.metrics.report import run_timeline
from swarmwire.metrics.report.page import Listing, Table, blank_figure
from swarmwire.metrics.report.run import run_report
from swarmwire.metrics.report.run_data import Span, read_run
from swarmwire.metrics.report.run_metrics import of_metrics
from swarmwire.metrics.run_folder.layout import MetricInfo
from swarmwire.metrics.run_folder.reader import RunFolder
from swarmwire.metrics.text import number
from tests.support.metrics.radio_runs import DISK, ticks
from tests.support.metrics.recorded import links, wandering
from tests.support.metrics.report.run_folders import run_folder
from tests.support.metrics.truths import departed, static, tally

pytest.importorskip("matplotlib", reason="needs the extra [report]")
page = pytest.importorskip("swarmwire.metrics.report.page").page


def texts(report):
    """All paragraphs, listings and captions, a line each."""
    parts = [part for section in report.sections for part in section.parts]
    return "\n".join(
        part if isinstance(part, str) else part.text if isinstance(part, Listing) else part.caption for part in parts
    )


def table(report, caption):
    """The rows of the one table whose caption begins so, by their first cell."""
    parts = [part for section in report.sections for part in section.parts if isinstance(part, Table)]
    found = next(part for part in parts if part.caption.startswith(caption))
    return {row[0]: row[1:] for row in found.rows}


def names(report):
    return [figure.name for figure in report.figures]


def test_a_run_with_all_tables_has_every_figure_and_the_numbers_of_its_summary(tmp_path):
    folder = run_folder(tmp_path, static(6), ticks(DISK, static(6), 3, count=30), packets=1.0, links=True)
    report = run_report(folder)
    assert names(report) == ["timeline", "trajectories", "metrics", "delivery-by-distance", "latency", "links"]
    summary = RunFolder(folder).summary
    assert summary is not None
    fates = table(report, "Fates of packets")
    told = {name: int(row[0].replace(",", "")) for name, row in fates.items()}
    assert told == {name.replace("_", " "): count for name, count in summary["radio"]["fates"].items() if count}
    metrics = table(report, "Metrics over")
    assert metrics["order"][:4] == tuple(
        number(summary["metrics"]["order"][key]) for key in ("final", "mean", "min", "max")
    )
    assert "`target_best`" in texts(report)
    assert "`clipped_commands` 3." in texts(report)
    assert f"swarmwire repeat {folder.name}" in texts(report)
    assert f"`{0:064x}`" in texts(report)
    html = page(report)
    assert all(f'id="{name}-' in html for name in names(report))


def test_tables_that_were_not_recorded_are_named_with_the_command_that_records_them(tmp_path):
    folder = run_folder(tmp_path, static(6), ticks(DISK, static(6), 3))
    report = run_report(folder)
    assert names(report) == ["timeline", "trajectories", "metrics", "delivery-by-distance"]
    said = texts(report)
    assert all(name in said for name in ("`packets`", "`radio_links`"))
    assert f"swarmwire repeat {folder.name} --packets all --links --out {folder.name}-again" in said
    assert table(report, "Latencies of all packets")["on air"]


def test_links_come_from_packets_where_they_were_not_counted(tmp_path):
    report = run_report(run_folder(tmp_path, static(6), ticks(DISK, static(6), 3), packets=1.0))
    assert names(report)[-1] == "links"


def test_a_run_without_a_radio_says_so(tmp_path):
    of = static(4, radio=False)
    report = run_report(run_folder(tmp_path, of, wandering(of, 12)))
    assert names(report) == ["timeline", "trajectories", "metrics"]
    assert "no radio" in texts(report)


def test_of_several_arenas_the_first_is_drawn_and_tables_are_of_all(tmp_path):
    of = static(5, arenas=3)
    report = run_report(run_folder(tmp_path, of, ticks(DISK, of, 4, count=20), links=True))
    assert "first of 3 arenas, seed 1" in texts(report)
    assert list(table(report, "All arenas")) == ["1", "2", "3"]
    assert table(report, "All arenas")["3"][-1] == f"{2:064x}"[:16] + "…"
    summary = RunFolder(tmp_path).summary
    assert summary is not None
    finals = [arena["order"]["final"] for arena in summary["metrics"]]
    assert table(report, "Final values")["order"][:2] == ("3", number(min(finals)))
    received = sum(arena["fates"]["received"] for arena in summary["radio"])
    assert table(report, "Fates of packets in 3 arenas")["received"][0] == f"{received:,}"


def test_a_killed_run_is_reported_up_to_its_last_tick(tmp_path):
    of = static(6)
    seen = list(ticks(DISK, of, 3, count=30))
    (tmp_path / "killed").mkdir()
    killed = run_folder(tmp_path / "killed", of, seen, summary=False, packets=1.0)
    (tmp_path / "killed" / "radio_distances.parquet").unlink()
    report = run_report(killed)
    assert names(report) == ["timeline", "trajectories", "metrics", "latency", "links"]
    assert "2.9 s of 5 s" in table(report, "")["ended"][0]
    assert "`radio_distances`" in texts(report)
    (tmp_path / "whole").mkdir()
    whole = read_run(run_folder(tmp_path / "whole", of, seen))
    for name, values in of_metrics(read_run(killed)).items():
        expected = of_metrics(whole)[name]
        assert {key: pytest.approx(value, nan_ok=True) for key, value in expected.items()} == values, name


def test_a_run_without_a_tick_is_reported_too(tmp_path):
    report = run_report(run_folder(tmp_path, static(2), [], summary=False))
    assert names(report) == []
    assert "No tick" in texts(report)
    page(report)


@pytest.mark.parametrize("radio", [True, False])
def test_a_robot_alone_has_a_report(tmp_path, radio):
    of = static(1, radio=radio)
    silent = {"departed": departed([]), "finished": links([], [], 0, 0), "tally": tally({})} if radio else {}
    report = run_report(run_folder(tmp_path, of, wandering(of, 9, **silent), links=True))
    assert names(report)[:2] == ["timeline", "trajectories"]
    assert ("nobody was in range" in texts(report)) == radio


def test_what_users_name_is_escaped(tmp_path):
    of = replace(static(3), name="<script>alert(1)</script>", robot_names=("<b>", "&", "$x_1$"))
    html = page(run_report(run_folder(tmp_path, of, ticks(DISK, of, 3), links=True)))
    assert "<script" not in html
    assert "<b>" not in html
    assert "&lt;script&gt;" in html


def test_a_damaged_table_costs_its_figure_and_is_named(tmp_path):
    folder = run_folder(tmp_path, static(6), ticks(DISK, static(6), 3), packets=1.0, links=True)
    for name in ("radio_distances", "radio_links"):
        file = folder / f"{name}.parquet"
        pl.read_parquet(file).drop("arena").write_parquet(file)
    (folder / "packets.parquet").write_bytes(b"no table")
    report = run_report(folder)
    assert names(report) == ["timeline", "trajectories", "metrics"]
    for name in ("radio_distances", "radio_links", "packets"):
        assert f"{folder / name}.parquet" in texts(report)
    assert "`swarmwire verify`" in texts(report)


def test_events_are_listed_with_the_robots_that_they_changed(tmp_path):
    of = static(3)
    kill = EventRecord(0, 0.1, "kill", False, np.array([False, True, True]))
    seen = [replace(one, events=(kill,) if one.tick == 1 else ()) for one in wandering(of, 6)]
    report = run_report(run_folder(tmp_path, of, seen))
    assert table(report, "All events") == {"0.1": ("kill", "flock-1, flock-2")}


def test_what_stopped_a_run_and_the_times_that_metrics_wait_for_are_marked(tmp_path, monkeypatch):
    of, drawn = static(3), []
    folder = run_folder(tmp_path, of, wandering(of, 20), ended="stopped")
    summary = json.loads((folder / "summary.json").read_text())
    end = {
        "ended": "stopped",
        "ticks": 20,
        "sim_time_s": 2.0,
        "stop_time_s": 0.7,
        "stopped_by": "order at least 0.1 for 1 s",
    }
    (folder / "summary.json").write_text(json.dumps({**summary, "stop": [end["stopped_by"]], "by_arena": [end]}))
    file = folder / "ticks.parquet"
    found = pl.when(pl.col("tick") > 11).then(1.2).alias("aggregation_time_s")
    pl.read_parquet(file).with_columns(found).write_parquet(file)
    monkeypatch.setattr(run_timeline, "timeline", lambda *of: (drawn.append(of), blank_figure(1.0, 1.0))[1])
    report = run_report(folder)
    [(_, _, lanes)] = drawn
    assert {lane.words: lane.spans for lane in lanes} == {
        "stop: order at least 0.1 for 1 s, since 0.7 s": [Span(0.7, None)],
        "aggregation_time: 1.2 s": [Span(1.2, None)],
    }
    about = table(report, "")
    assert about["stops at"] == ("order at least 0.1 for 1 s",)
    assert about["ended"] == ("stopped: order at least 0.1 for 1 s, since 0.7 s",)


def test_of_a_metric_of_the_users_own_what_the_run_kept_of_it_counts(tmp_path):
    of = static(3)
    folder = run_folder(tmp_path, of, wandering(of, 20), summary=False)
    gas = MetricInfo("gas", "what it smells of", "ppm", "count", (0.0, None))
    found = MetricInfo("gas_found", "when it did", "s", "time", (0.0, None))
    started = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps({**started, "metrics": [asdict(gas), asdict(found)]}))
    file = folder / "ticks.parquet"
    own = (pl.col("tick") * 2.0).alias("gas"), pl.when(pl.col("tick") > 9).then(1.0).alias("gas_found")
    pl.read_parquet(file).with_columns(*own).write_parquet(file)
    metrics = table(run_report(folder), "Metrics over")
    assert metrics["gas"][:5] == ("38", "1.9", "0", "2", "ppm")
    (smells, adds_up), (found, is_time) = (metrics[name][-1].split("; ") for name in ("gas", "gas_found"))
    assert (smells, found) == ("what it smells of", "when it did")
    assert adds_up != is_time
    film = read_run(folder).film
    assert not isinstance(film, str)
    [shown] = [curve for curve in run_timeline.curves(film, run_timeline.second(film)) if "gas" in curve.name]
    assert shown.title == "gas (ppm)"


def test_what_is_no_run_folder_is_refused(tmp_path):
    for folder, where in ((tmp_path / "none", tmp_path / "none"), (tmp_path, tmp_path / "static.json")):
        with pytest.raises(BadInput, check=lambda error, where=where: error.where == str(where)):
            run_report(folder)
