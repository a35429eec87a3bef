"""The figures of a run hold the numbers that they are drawn from."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.packets import Fate
from swarmwire.metrics.network.latency import Latencies
from swarmwire.metrics.report.page import as_svg
from swarmwire.metrics.report.run_data import Lane, Span, lanes_of, thinned
from swarmwire.metrics.report.run_links import link_histogram, link_matrix, of_links
from swarmwire.metrics.report.run_paths import MAX_PATHS, MAX_POINTS, paths_of, trajectories
from swarmwire.metrics.report.run_radio import delivery_by_distance, latency_histogram, percentiles, receivers_act_at_ns
from swarmwire.metrics.report.run_timeline import MAX_PANELS, Curve, small_panels, timeline
from swarmwire.metrics.run_folder.reader import RunFolder
from swarmwire.metrics.statistics.bootstrap import binomial_interval
from tests.support.metrics.films import two_groups
from tests.support.metrics.radio_runs import RADIOS, ticks
from tests.support.metrics.recorded import record
from tests.support.metrics.truths import static

pytest.importorskip("matplotlib", reason="needs the extra [report]")

TIME_S = np.arange(50) / 10


def test_panels_share_their_time_and_hold_the_curves():
    order, pieces = np.linspace(0.0, 1.0, 50), np.repeat([1.0, 3.0], 25)
    lanes = [Lane("kill", [Span(1.0, 2.5), Span(4.0, None)], {"a"})]
    curves = [Curve("order", "order", order), Curve("components", "components", pieces, whole=True)]
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


def test_many_metrics_are_small_and_the_first_of_very_many():
    curves = [Curve(f"own_{i}", f"own {i}", TIME_S * i) for i in range(MAX_PANELS + 3)]
    figure = small_panels(TIME_S, curves)
    assert [axes.get_title("left") for axes in figure.axes] == [f"own {i}" for i in range(MAX_PANELS)]
    np.testing.assert_array_equal(figure.axes[2].lines[0].get_ydata(), TIME_S * 2)


def events(*rows):
    names = ("do", "part", "time_s", "ended", "robots")
    return pl.DataFrame([dict(zip(names, row, strict=True)) for row in rows], infer_schema_length=None)


def test_an_end_belongs_to_the_first_open_occurrence_of_the_same_robots():
    kill, motors = Lane("kill"), Lane("fail motors")
    kill.spans, kill.robots = [Span(1.0, 6.0), Span(2.0, 5.0)], {"a", "b"}
    motors.spans, motors.robots = [Span(3.0, None)], {"c"}
    found = lanes_of(
        events(
            ("kill", "", 1.0, False, ["a"]),
            ("kill", "", 2.0, False, ["b"]),
            ("fail", "motors", 3.0, False, ["c"]),
            ("kill", "", 5.0, True, ["b"]),
            ("kill", "", 6.0, True, []),
            ("revive", "", 7.0, True, ["a"]),
        )
    )
    assert found == [kill, motors]


def test_thinned_curves_keep_their_peaks_and_gaps():
    value = np.sin(np.arange(10_000) / 300)
    value[777], value[888], value[4000:6000] = 9.0, -9.0, np.nan
    kept = thinned(value, 100)
    assert len(kept) <= 102
    assert {0, 777, 888, 9999} <= set(kept.tolist())
    assert (np.diff(kept) > 0).all()
    assert np.isnan(value[kept]).any()
    assert thinned(np.zeros(7), 7).tolist() == list(range(7))


def test_every_place_is_drawn_of_a_small_run():
    of = two_groups()
    place_m = np.random.default_rng(1).uniform(-3, 3, (30, 3, 2))
    paths = paths_of(place_m, of)
    drawn = np.stack(paths.line(np.array([0, 2]), 0, 29), axis=1)
    np.testing.assert_array_equal(drawn[:30], place_m[:, 0])
    assert np.isnan(drawn[30]).all()
    second = drawn[~np.isnan(drawn).any(axis=1)][30:]
    np.testing.assert_array_equal(second, place_m[:, 2])


def test_on_a_torus_the_pen_is_lifted_at_the_seam():
    of = replace(two_groups(), boundary="torus")  # 8 x 6 m
    along = np.array([2.0, 3.0, 3.9, -3.5, -3.0])
    place_m = np.zeros((5, 3, 2))
    place_m[:, 0, 0] = along
    x, _ = paths_of(place_m, of).line(np.array([0]), 0, 4)
    known = x[: np.flatnonzero(~np.isnan(x))[-1] + 1]
    np.testing.assert_array_equal(known, [2.0, 3.0, 3.9, np.nan, -3.5, -3.0])


def test_of_long_runs_of_many_robots_some_are_drawn_from_start_to_end():
    place_m = np.zeros((600, 3000, 2), np.float32)
    paths = paths_of(place_m, replace(two_groups()))
    assert len(paths.robots) == MAX_PATHS
    assert paths.place_m.size <= 2 * MAX_POINTS
    assert (paths.robots[0], paths.robots[-1], paths.ticks[0], paths.ticks[-1]) == (0, 2999, 0, 599)


@pytest.mark.parametrize(("robots", "most_bytes"), [(100, 700_000), (1000, 1_500_000)])
def test_trajectories_of_many_robots_stay_light(robots, most_bytes):
    of = replace(static(robots), arena_size_m=(30.0, 30.0))
    steps = np.random.default_rng(2).normal(0.0, 0.05, (600, robots, 2))
    place_m = np.cumsum(steps, axis=0) + np.random.default_rng(3).uniform(-14, 14, (robots, 2))
    pose = np.concatenate([place_m[-1], np.zeros((robots, 1))], axis=1)
    figure = trajectories(of, 0, paths_of(place_m, of), pose, np.ones(robots, np.bool_), None, 59.9)
    assert len(as_svg(figure, "trajectories")) < most_bytes


def test_trajectories_are_coloured_by_group_where_there_are_several_else_by_time():
    of = two_groups()
    place_m = np.random.default_rng(1).uniform(-3, 3, (30, 3, 2))
    pose = np.zeros((3, 3))
    arena = trajectories(of, 0, paths_of(place_m, of), pose, np.ones(3, np.bool_), None, 2.9).axes[0]
    assert [line.get_label() for line in arena.lines[:2]] == ["small", "large"]
    alone = replace(of, groups=(replace(of.groups[0], stop=3),))
    figure = trajectories(alone, 0, paths_of(place_m, alone), pose, np.ones(3, np.bool_), None, 2.9)
    colors = [line.get_color() for line in figure.axes[0].lines[:6]]
    assert len(set(colors)) == 6
    assert "2.9 s" in [text.get_text() for text in figure.axes[1].texts]


def test_ratios_over_distance_have_their_binomial_intervals():
    received, intended = np.array([9, 5, 0]), np.array([10, 10, 4])
    table = pl.DataFrame(
        {
            "from_m": [0.0, 1.0, 2.0],
            "to_m": [1.0, 2.0, 3.0],
            "intended": intended,
            "received": received,
            "pdr": received / intended,
        }
    )
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
    of = static(5)
    seen = list(ticks(radio, of, 7, count=40))
    latencies, agent_ns = Latencies(of), []
    for one in seen:
        assert one.finished is not None
        agent_ns += latencies.of(one.finished, one.tick)[2].tolist()
    record(tmp_path, of, seen, packets=1.0)
    received = RunFolder(tmp_path).packets().filter(pl.col("fate") == "received")
    final, sent, receiver = (received[name].to_numpy() for name in ("final_at_ns", "sent_at_ns", "receiver"))
    assert sorted(receivers_act_at_ns(final, receiver, of) - sent) == sorted(agent_ns)
    assert len(agent_ns) > 20


def test_links_add_up_to_the_account_of_the_radio(tmp_path):
    of = static(6)
    seen = list(ticks(RADIOS[1], of, 3, count=30))
    record(tmp_path, of, seen, links=True)
    received, in_range = of_links(RunFolder(tmp_path).radio_links(), of.robots)
    fates = np.sum([one.tally.fates[0] for one in seen if one.tally], axis=0)
    assert received.sum() == fates[Fate.RECEIVED]
    assert (received <= in_range).all()
    assert not in_range.diagonal().any()
    rows = RunFolder(tmp_path).radio_links()["packets"].sum()
    assert in_range.sum() == rows - fates[Fate.BLOCKED] > 0


def test_a_matrix_has_a_square_for_each_link_and_names_for_few_robots():
    pdr = np.array([[np.nan, 0.25], [1.0, np.nan]])
    axes = link_matrix(replace(static(2), robot_names=("left", "a-very-long-name")), pdr).axes[0]
    shown = axes.images[0].get_array()
    np.testing.assert_array_equal(shown.filled(np.nan), pdr)
    assert [text.get_text() for text in axes.texts] == ["25", "100"]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["left", "a-very-lon…"]
    many = link_matrix(static(40), np.full((40, 40), 0.5)).axes[0]
    assert [label.get_text() for label in many.get_yticklabels()] == ["flock"]


def test_links_of_many_robots_are_counted_by_their_ratio():
    axes = link_histogram(np.array([0.0, 0.5, 0.51, 1.0])).axes[0]
    counts = axes.patches[0].get_data().values
    assert (counts[0], counts[12], counts[-1], counts.sum()) == (1, 2, 1, 4)
