import json
from dataclasses import asdict, replace

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import EventRecord
from swarmwire.comms.robot.packets import Fate
from swarmwire.metrics.measures.metric import MetricInfo
from swarmwire.metrics.measures.network.latency import Latencies
from swarmwire.metrics.pictures.report import run_timeline
from swarmwire.metrics.pictures.report.page import Listing, ReportTable, blank_figure, svg_of
from swarmwire.metrics.pictures.report.run import metric_statistics, run_report
from swarmwire.metrics.pictures.report.run_data import Lane, Span, lanes_of, read_run, thinned
from swarmwire.metrics.pictures.report.run_links import link_counts, link_matrix
from swarmwire.metrics.pictures.report.run_paths import MAX_PATHS, MAX_POINTS, Ending, paths_of, trajectories
from swarmwire.metrics.pictures.report.run_radio import (
    delivery_by_distance,
    latency_histogram,
    percentiles,
    receivers_act_at_ns,
)
from swarmwire.metrics.pictures.report.run_timeline import Curve, timeline
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.statistics.bootstrap import binomial_interval
from swarmwire.metrics.text import number
from tests.support.metrics.films import two_groups
from tests.support.metrics.radio import DISK, RADIOS, ticks
from tests.support.metrics.recorded import links, record, wandering
from tests.support.metrics.report import Page, run_folder
from tests.support.metrics.truths import departed, static, tally

pytest.importorskip("matplotlib", reason="needs the extra [report]")
page = pytest.importorskip("swarmwire.metrics.pictures.report.page").page
TIME_S = np.arange(50) / 10
PACE = {"factor": 1.0, "missed_ticks": 0, "worst_lag_s": 0.0, "subtick_s": None, "tick_jitter": None, "delivery": None}


def texts(report):
    """All paragraphs, listings and captions, a line each."""
    parts = [part for section in report.sections for part in section.parts]
    return "\n".join(
        part if isinstance(part, str) else part.text if isinstance(part, Listing) else part.caption for part in parts
    )


def table(report, caption):
    """The rows of the one table whose caption begins so, by their first cell."""
    parts = [part for section in report.sections for part in section.parts if isinstance(part, ReportTable)]
    match = next(part for part in parts if part.caption.startswith(caption))
    return {row[0]: row[1:] for row in match.rows}


def summary_changed(folder, **changes):
    """Change the summary of a run folder."""
    file = folder / "summary.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), **changes}))


def names(report):
    return [figure.name for figure in report.figures]


def test_report_of_all_tables_has_every_figure_and_numbers_of_the_summary(tmp_path):
    folder = run_folder(tmp_path, static(6), ticks(DISK, static(6), 3, count=30), packets=1.0, links=True)
    report = run_report(folder)
    assert names(report) == ["timeline", "trajectories", "metrics", "delivery-by-distance", "latency", "links"]
    summary = RunFolder(folder).summary
    assert summary is not None
    fates = table(report, "Fates of packets")
    counts = {name: int(row[0].replace(",", "")) for name, row in fates.items()}
    assert counts == {name.replace("_", " "): count for name, count in summary["radio"]["fates"].items() if count}
    metrics = table(report, "Metrics over")
    assert metrics["order"][:4] == tuple(
        number(summary["metrics"]["order"][key]) for key in ("final", "mean", "min", "max")
    )
    assert "`target_best`" in texts(report)
    assert "`clipped_commands` 3." in texts(report)
    assert f"swarmwire repeat {folder.name}" in texts(report)
    assert f"`{0:064x}`" in texts(report)
    assert Page(page(report)).images == [figure.svg for figure in report.figures]


def test_tables_that_were_not_recorded_are_named_with_the_command_that_records_them(tmp_path):
    folder = run_folder(tmp_path, static(6), ticks(DISK, static(6), 3))
    report = run_report(folder)
    assert names(report) == ["timeline", "trajectories", "metrics", "delivery-by-distance"]
    text = texts(report)
    assert all(name in text for name in ("`packets`", "`radio_links`"))
    assert f"swarmwire repeat {folder.name} --packets all --links --out {folder.name}-again" in text
    assert table(report, "Latencies of all packets")["on air"]


def test_links_come_from_packets_where_they_were_not_counted(tmp_path):
    report = run_report(run_folder(tmp_path, static(6), ticks(DISK, static(6), 3), packets=1.0))
    assert names(report)[-1] == "links"


def test_report_of_a_run_without_a_radio_says_so(tmp_path):
    run = static(4, radio=False)
    report = run_report(run_folder(tmp_path, run, wandering(run, 12)))
    assert names(report) == ["timeline", "trajectories", "metrics"]
    assert "no radio" in texts(report)
    assert "Real time" not in [section.title for section in report.sections]


def test_report_of_several_arenas_draws_the_first_and_tabulates_all(tmp_path):
    run = static(5, arenas=3)
    report = run_report(run_folder(tmp_path, run, ticks(DISK, run, 4, count=20), links=True))
    assert "first of 3 arenas, seed 1" in texts(report)
    assert list(table(report, "All arenas")) == ["1", "2", "3"]
    assert table(report, "All arenas")["3"][-1] == f"{2:064x}"[:16] + "…"
    summary = RunFolder(tmp_path).summary
    assert summary is not None
    finals = [arena["order"]["final"] for arena in summary["metrics"]]
    assert table(report, "Final values")["order"][:2] == ("3", number(min(finals)))
    received = sum(arena["fates"]["received"] for arena in summary["radio"])
    assert table(report, "Fates of packets in 3 arenas")["received"][0] == f"{received:,}"


def test_report_of_a_killed_run_reaches_to_its_last_tick(tmp_path):
    run = static(6)
    truths = list(ticks(DISK, run, 3, count=30))
    (tmp_path / "killed").mkdir()
    killed = run_folder(tmp_path / "killed", run, truths, summary=False, packets=1.0)
    (tmp_path / "killed" / "radio_distances.parquet").unlink()
    report = run_report(killed)
    assert names(report) == ["timeline", "trajectories", "metrics", "latency", "links"]
    assert "2.9 s of 5 s" in table(report, "")["ended"][0]
    assert "`radio_distances`" in texts(report)
    (tmp_path / "whole").mkdir()
    complete = read_run(run_folder(tmp_path / "whole", run, truths))
    for name, values in metric_statistics(read_run(killed)).items():
        expected = metric_statistics(complete)[name]
        assert {key: pytest.approx(value, nan_ok=True) for key, value in expected.items()} == values, name


def test_report_of_a_run_without_a_tick_has_no_figures(tmp_path):
    report = run_report(run_folder(tmp_path, static(2), [], summary=False))
    assert names(report) == []
    assert "No tick" in texts(report)
    page(report)


@pytest.mark.parametrize("radio", [True, False])
def test_report_of_a_lone_robot_exists_with_and_without_a_radio(tmp_path, radio):
    run = static(1, radio=radio)
    silent = {"departed": departed([]), "finished": links([], [], 0, 0), "tally": tally({})} if radio else {}
    report = run_report(run_folder(tmp_path, run, wandering(run, 9, **silent), packets=1.0, links=True))
    assert names(report)[:2] == ["timeline", "trajectories"]
    assert ("no two robots were in range" in texts(report)) == radio
    assert "--packets all" not in texts(report)  # all tables were recorded


def test_names_with_markup_are_escaped_in_a_report(tmp_path):
    run = replace(static(3), name="<script>alert(1)</script>", robot_names=("<b>", "&", "$x_1$"))
    html = page(run_report(run_folder(tmp_path, run, ticks(DISK, run, 3), links=True)))
    assert "<script" not in html
    assert "<b>" not in html
    assert "&lt;script&gt;" in html


def test_damaged_table_costs_its_figure_and_is_named(tmp_path):
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
    run = static(3)
    kill = EventRecord(0, 0.1, "kill", False, np.array([False, True, True]))
    truths = [replace(one, events=(kill,) if one.tick == 1 else ()) for one in wandering(run, 6)]
    report = run_report(run_folder(tmp_path, run, truths))
    assert table(report, "All events") == {"0.1": ("kill", "flock-1, flock-2")}


def test_stop_of_a_run_and_times_of_metrics_are_marked_in_a_report(tmp_path, monkeypatch):
    run, drawn = static(3), []
    folder = run_folder(tmp_path, run, wandering(run, 20), ended="stopped")
    condition = "order at least 0.1 for 1 s"
    end = {"ended": "stopped", "ticks": 20, "sim_time_s": 2.0, "stop_time_s": 0.7, "stopped_by": condition}
    summary_changed(folder, stop=[condition], by_arena=[end])
    file = folder / "ticks.parquet"
    column = pl.when(pl.col("tick") > 11).then(1.2).alias("aggregation_time_s")
    pl.read_parquet(file).with_columns(column).write_parquet(file)
    monkeypatch.setattr(
        run_timeline, "timeline", lambda *arguments: (drawn.append(arguments), blank_figure(1.0, 1.0))[1]
    )
    report = run_report(folder)
    [(_, _, lanes)] = drawn
    assert {lane.kind: lane.spans for lane in lanes} == {
        "stop: order at least 0.1 for 1 s, since 0.7 s": [Span(0.7, None)],
        "aggregation_time: 1.2 s": [Span(1.2, None)],
    }
    about = table(report, "")
    assert about["stops at"] == ("order at least 0.1 for 1 s",)
    assert about["ended"] == ("stopped: order at least 0.1 for 1 s, since 0.7 s",)


def test_lateness_of_a_real_time_run_is_reported(tmp_path):
    folder = run_folder(tmp_path, static(3), wandering(static(3), 6))
    delays = {"count": 1500, "p50_s": 0.0011, "p99_s": 0.0029, "worst_s": 0.0071}
    pace = {"missed_ticks": 2, "worst_lag_s": 0.004, "subtick_s": 0.001, "tick_jitter": {**delays, "count": 6}}
    frames = {"sent": 1100, "sent_bytes": 220_000, "delivered": 1500, "delivered_bytes": 300_000, "late": 15}
    summary_changed(folder, realtime=PACE | pace, interfaces={**frames, "delivery": delays})
    report = run_report(folder)
    assert table(report, "Lateness") == {
        "ticks": ("6", "1.1", "2.9", "7.1"),
        "frames to interfaces": ("1,500", "1.1", "2.9", "7.1"),
    }
    assert "1 × real time in sub-ticks of 1 ms; 2 of 6 ticks missed, at worst by 4 ms" in texts(report)
    assert "1,500 (300,000 bytes) were delivered" in texts(report)
    assert "15 of them (1.0%) more than 3 ms late" in texts(report)
    assert "Lateness" in page(report)


def test_gaps_in_poses_from_outside_are_reported_by_robot_the_longest_first(tmp_path):
    folder = run_folder(tmp_path, static(3), wandering(static(3), 6))
    source = {
        "source": "udp 127.0.0.1:9870",
        "received": 1234,
        "use": {"count": 1234, "p50_s": 0.0005, "p99_s": 0.0011, "worst_s": 0.003},
        "longest_gap_s": {"flock-0": 0.021, "flock-1": 1.5, "flock-2": 0.25},
        "silent_ticks": {"flock-1": 5},
    }
    summary_changed(folder, realtime=PACE, poses=[source])
    report = run_report(folder)
    gaps = table(report, "Poses from udp 127.0.0.1:9870: 1,234 were used, 99 % of them within 1.1 ms of their arrival")
    assert list(gaps.items()) == [("flock-1", ("1.5", "5")), ("flock-2", ("0.25", "0")), ("flock-0", ("0.021", "0"))]
    assert "longest gap in s" in page(report)


def test_relayed_topics_are_reported_by_robot_and_in_all(tmp_path):
    folder = run_folder(tmp_path, static(3), wandering(static(3), 6))
    robots = {
        "flock-0": {"messages": 1200, "received": 5, "packets": 3610, "sent_bytes": 4_800_000},
        "flock-1": {"messages": 0, "received": 1100, "packets": 12, "sent_bytes": 240},
    }
    messages = {"messages": 1200, "intended": 1205, "received": 1105, "lost": 100}
    packets = {"packets": 3622, "sent_bytes": 4_800_240, "repeated": 10, "requests": 12}
    topic = {"topic": "map", "reliable": True, **messages, **packets, "robots": robots}
    summary_changed(folder, realtime=PACE, relay=[topic])
    assert table(run_report(folder), "Topic map over the radio") == {
        "flock-0": ("1,200", "5", "3,610", "4,800,000"),
        "flock-1": ("0", "1,100", "12", "240"),
        "all": ("1,200", "1,105", "3,622", "4,800,240"),
    }


def test_custom_metric_is_reported_by_its_recorded_facts(tmp_path):
    run = static(3)
    folder = run_folder(tmp_path, run, wandering(run, 20), summary=False)
    gas = MetricInfo("gas", "what it smells of", "ppm", "count", (0.0, None))
    detection = MetricInfo("gas_found", "when it did", "s", "time", (0.0, None))
    started = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps({**started, "metrics": [asdict(gas), asdict(detection)]}))
    file = folder / "ticks.parquet"
    own = (pl.col("tick") * 2.0).alias("gas"), pl.when(pl.col("tick") > 9).then(1.0).alias("gas_found")
    pl.read_parquet(file).with_columns(*own).write_parquet(file)
    metrics = table(run_report(folder), "Metrics over")
    assert metrics["gas"][:5] == ("38", "1.9", "0", "2", "ppm")
    (smells, adds_up), (when, is_time) = (metrics[name][-1].split("; ") for name in ("gas", "gas_found"))
    assert (smells, when) == ("what it smells of", "when it did")
    assert adds_up != is_time
    film = read_run(folder).film
    assert not isinstance(film, str)
    [shown] = [
        curve for curve in run_timeline.curves(film, run_timeline.secondary_metrics(film)) if "gas" in curve.name
    ]
    assert shown.title == "gas (ppm)"


def test_folder_without_a_run_is_refused_by_a_report(tmp_path):
    for folder, where in ((tmp_path / "none", tmp_path / "none"), (tmp_path, tmp_path / "static.json")):
        with pytest.raises(BadInput, check=lambda error, where=where: error.where == str(where)):
            run_report(folder)


def test_panels_share_their_time_and_hold_the_curves():
    order, pieces = np.linspace(0.0, 1.0, 50), np.repeat([1.0, 3.0], 25)
    lanes = [Lane("kill", [Span(1.0, 2.5), Span(4.0, None)], {"a"})]
    curves = [Curve("order", "order", order), Curve("components", "components", pieces, is_integer=True)]
    above, upper, lower = timeline(TIME_S, curves, lanes).axes
    assert above.get_xlim() == upper.get_xlim() == lower.get_xlim() == (0.0, 4.9)
    np.testing.assert_array_equal(upper.lines[0].get_xydata(), np.stack([TIME_S, order], axis=1))
    np.testing.assert_array_equal(lower.lines[0].get_ydata(), pieces)
    assert lower.lines[0].get_drawstyle() == "steps-post"
    assert [line.get_xdata()[0] for line in upper.lines[1:]] == [1.0, 4.0]
    assert "kill, 2" in above.texts[0].get_text()
    [bar] = above.collections[-1].get_paths()
    assert (bar.vertices[:, 0].min(), bar.vertices[:, 0].max()) == (1.0, 2.5)
    assert above.lines[-1].get_xdata() == [4.0]


def events(*rows):
    names = ("do", "part", "time_s", "ended", "robots")
    return pl.DataFrame([dict(zip(names, row, strict=True)) for row in rows], infer_schema_length=None)


def test_event_end_belongs_to_the_first_open_event_of_the_same_robots():
    kill, motors = Lane("kill"), Lane("fail motors")
    kill.spans, kill.robots = [Span(1.0, 6.0), Span(2.0, 5.0)], {"a", "b"}
    motors.spans, motors.robots = [Span(3.0, None)], {"c"}
    lanes = lanes_of(
        events(
            ("kill", "", 1.0, False, ["a"]),
            ("kill", "", 2.0, False, ["b"]),
            ("fail", "motors", 3.0, False, ["c"]),
            ("kill", "", 5.0, True, ["b"]),
            ("kill", "", 6.0, True, []),
            ("revive", "", 7.0, True, ["a"]),
        )
    )
    assert lanes == [kill, motors]


def test_thinned_curves_keep_their_peaks_and_gaps():
    value = np.sin(np.arange(10_000) / 300)
    value[777], value[888], value[4000:6000] = 9.0, -9.0, np.nan
    indices = thinned(value, 100)
    assert len(indices) <= 102
    assert {0, 777, 888, 9999} <= set(indices.tolist())
    assert (np.diff(indices) > 0).all()
    assert np.isnan(value[indices]).any()
    assert thinned(np.zeros(7), 7).tolist() == list(range(7))


def test_trajectories_of_a_small_run_have_every_position():
    run = two_groups()
    place_m = np.random.default_rng(1).uniform(-3, 3, (30, 3, 2))
    paths = paths_of(place_m, run)
    drawn = np.stack(paths.line(np.array([0, 2]), 0, 29), axis=1)
    np.testing.assert_array_equal(drawn[:30], place_m[:, 0])
    assert np.isnan(drawn[30]).all()
    second = drawn[~np.isnan(drawn).any(axis=1)][30:]
    np.testing.assert_array_equal(second, place_m[:, 2])


def test_on_a_torus_the_pen_is_lifted_at_the_seam():
    run = replace(two_groups(), boundary="torus")  # 8 x 6 m
    along = np.array([2.0, 3.0, 3.9, -3.5, -3.0])
    place_m = np.zeros((5, 3, 2))
    place_m[:, 0, 0] = along
    x, _ = paths_of(place_m, run).line(np.array([0]), 0, 4)
    trail_m = x[: np.flatnonzero(~np.isnan(x))[-1] + 1]
    np.testing.assert_array_equal(trail_m, [2.0, 3.0, 3.9, np.nan, -3.5, -3.0])


def test_trajectories_of_large_runs_are_thinned_from_start_to_end():
    place_m = np.zeros((600, 3000, 2), np.float32)
    paths = paths_of(place_m, replace(two_groups()))
    assert len(paths.robots) == MAX_PATHS
    assert paths.position_m.size <= 2 * MAX_POINTS
    assert (paths.robots[0], paths.robots[-1], paths.ticks[0], paths.ticks[-1]) == (0, 2999, 0, 599)


@pytest.mark.parametrize(("robots", "most_bytes"), [(100, 700_000), (1000, 1_500_000)])
def test_trajectories_of_many_robots_stay_light(robots, most_bytes):
    run = replace(static(robots), arena_size_m=(30.0, 30.0))
    steps = np.random.default_rng(2).normal(0.0, 0.05, (600, robots, 2))
    place_m = np.cumsum(steps, axis=0) + np.random.default_rng(3).uniform(-14, 14, (robots, 2))
    pose = np.concatenate([place_m[-1], np.zeros((robots, 1))], axis=1)
    figure = trajectories(run, 0, paths_of(place_m, run), Ending(pose, np.ones(robots, np.bool_), None, 59.9))
    assert len(svg_of(figure)) < most_bytes


def test_ratios_over_distance_have_their_binomial_intervals():
    received, intended = np.array([9, 5, 0]), np.array([10, 10, 4])
    counts = {"intended": intended, "received": received, "pdr": received / intended}
    table = pl.DataFrame({"from_m": [0.0, 1.0, 2.0], "to_m": [1.0, 2.0, 3.0], **counts})
    upper, lower = delivery_by_distance(table, 2.0).axes
    np.testing.assert_array_equal(upper.lines[0].get_ydata(), received / intended)
    bars = np.array([segment[:, 1] for segment in upper.collections[0].get_segments()])
    np.testing.assert_allclose(bars.T, binomial_interval(received, intended))
    assert lower.patches[0].get_data().values.tolist() == intended.tolist()


def test_latencies_add_up_to_all_receivers_and_show_their_percentiles():
    air_s = np.random.default_rng(1).exponential(0.01, 1000) + 0.001
    agent_s = air_s + 0.05
    upper, lower = latency_histogram(air_s, agent_s).axes
    for axes, latency_s in ((upper, air_s), (lower, agent_s)):
        assert axes.patches[0].get_data().values.sum() == pytest.approx(100.0)
        assert [line.get_xdata()[0] for line in axes.lines] == pytest.approx(percentiles(1e3 * latency_s))
    assert "p50 " in upper.get_title("left")


@pytest.mark.parametrize("radio", RADIOS[:3])
def test_packets_tell_when_their_receivers_act_as_the_summary_does(tmp_path, radio):
    run = static(5)
    truths = list(ticks(radio, run, 7, count=40))
    latencies, agent_ns = Latencies(run), []
    for one in truths:
        assert one.finished is not None
        agent_ns += latencies.measure(one.finished, one.tick)[2].tolist()
    record(tmp_path, run, truths, packets=1.0)
    received = RunFolder(tmp_path).packets().filter(pl.col("fate") == "received")
    final, sent, receiver = (received[name].to_numpy() for name in ("final_at_ns", "sent_at_ns", "receiver"))
    assert sorted(receivers_act_at_ns(final, receiver, run) - sent) == sorted(agent_ns)
    assert len(agent_ns) > 20


def test_links_add_up_to_the_account_of_the_radio(tmp_path):
    run = static(6)
    truths = list(ticks(RADIOS[1], run, 3, count=30))
    record(tmp_path, run, truths, links=True)
    received, in_range = link_counts(RunFolder(tmp_path).radio_links(), run.robots)
    fates = np.sum([one.tally.fates[0] for one in truths if one.tally], axis=0)
    assert received.sum() == fates[Fate.RECEIVED]
    assert (received <= in_range).all()
    assert not in_range.diagonal().any()
    rows = RunFolder(tmp_path).radio_links()["packets"].sum()
    assert in_range.sum() == rows - fates[Fate.BLOCKED] > 0


def test_link_matrix_has_a_square_per_link_and_names_of_few_robots():
    pdr = np.array([[np.nan, 0.25], [1.0, np.nan]])
    axes = link_matrix(replace(static(2), robot_names=("left", "a-very-long-name")), pdr).axes[0]
    shown = axes.images[0].get_array()
    np.testing.assert_array_equal(shown.filled(np.nan), pdr)
    assert [text.get_text() for text in axes.texts] == ["25", "100"]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["left", "a-very-lon…"]
    many = link_matrix(static(40), np.full((40, 40), 0.5)).axes[0]
    assert [label.get_text() for label in many.get_yticklabels()] == ["flock"]
