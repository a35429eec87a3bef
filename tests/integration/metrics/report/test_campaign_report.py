import json
import math

import numpy as np
import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.pictures.report.axes import fits_log
from swarmwire.metrics.pictures.report.campaign import campaign_report
from swarmwire.metrics.pictures.report.campaign_data import MAX_LEVELS, levels_of, rounding_of
from swarmwire.metrics.pictures.report.campaign_models import FittedShape, resilience_curve, scaling_curve
from swarmwire.metrics.pictures.report.campaign_survival import SurvivalCurve, share_curve, survival_curves
from swarmwire.metrics.pictures.report.charts import (
    GroupValues,
    HeatMap,
    Jump,
    MedianLine,
    distributions,
    heat_map,
    response_curve,
)
from swarmwire.metrics.pictures.report.page import page, svg_of, write_report
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.statistics.sample import Interval
from tests.support.metrics.campaigns import write_campaign
from tests.support.metrics.report import Page, check_alone

pytest.importorskip("matplotlib", reason="needs the extra [report]")
LOSS = [0.0, 0.2, 0.4, 0.6]
COUNTS = [5, 10, 20]
FEW = (1, 2, 3, 4, 5, 6)
NONE = (np.nan, np.nan, np.nan)
BEYOND = (np.inf, np.inf, np.inf)


def report_of(folder, responses=()):
    """The report's sections by title, and its page."""
    report = campaign_report(CampaignFolder(folder), responses)
    return {section.title: section for section in report.sections}, Page(page(report))


def ordinary(tmp_path, **differently):
    return write_campaign(tmp_path / "made-up", **{"vary": {"radio.loss": LOSS}, "seeds": FEW, **differently})


def test_report_of_one_parameter_has_curves_and_no_map(tmp_path):
    sections, shown = report_of(ordinary(tmp_path))
    assert list(sections) == [
        *("Transitions", "Survival", "Distributions", "Summary", "Resilience", "Setup", "Methods")
    ]
    names = [figure.name for section in sections.values() for figure in section.parts if hasattr(figure, "svg")]
    assert {"distribution-aggregation_time_s-radio.loss", "response-order.final-radio.loss"} < set(names)
    assert {"survival-aggregation_time_s-radio.loss", "resilience-order.final-radio.loss"} < set(names)
    assert not any(name.startswith("map") for name in names)
    assert shown.tags.count("figure") == len(names)
    check_alone(shown)


def test_report_of_two_parameters_has_maps_and_of_robot_counts_scaling(tmp_path):
    vary = {"radio.loss": LOSS, "robots.flock.count": COUNTS}
    sections, shown = report_of(ordinary(tmp_path, vary=vary, seeds=(1, 2, 3)), ["order", "aggregation_time_s"])
    maps = [part for part in sections["Transitions"].parts if hasattr(part, "svg")]
    assert [part.name for part in maps] == [
        f"map-{response}-radio.loss-robots.flock.count" for response in ("order.final", "aggregation_time_s")
    ]
    assert len(shown.table("response", "at")) == 2 * len(COUNTS)
    assert [row[0] for row in shown.table("robots.flock.count", "mean time in s")] == ["5", "10", "20"]
    check_alone(shown)


def test_names_beside_a_number_are_told_apart(tmp_path):
    vary = {"radio.loss": LOSS, "robots.flock.agent": ["flocking", "pso"]}
    sections, shown = report_of(ordinary(tmp_path, vary=vary, seeds=(1, 2, 3)), ["order"])
    assert [row[1] for row in shown.table("response", "at")] == [
        "robots.flock.agent flocking",
        "robots.flock.agent pso",
    ]
    assert len([part for part in sections["Distributions"].parts if hasattr(part, "svg")]) == 2


def test_three_numbers_are_drawn_in_pairs(tmp_path):
    vary = {"a.x": [0, 1, 2], "a.y": [1, 2], "a.z": [3, 4, 5]}
    sections, _ = report_of(ordinary(tmp_path, vary=vary, seeds=(1, 2)), ["order"])
    names = [part.name for part in sections["Transitions"].parts if hasattr(part, "svg")]
    assert names == [f"map-order.final-{pair}" for pair in ("a.x-a.y", "a.x-a.z", "a.y-a.z")]


def test_report_of_a_single_point_has_only_table_and_survival(tmp_path):
    sections, shown = report_of(ordinary(tmp_path, vary={}, points=[{}]))
    assert list(sections) == ["Survival", "Summary", "Setup", "Methods"]
    assert shown.table("n", "median")[0][0] == "6"


def test_many_points_are_put_together_into_ranges(tmp_path):
    points = [{"radio.loss": index / 100, "robots.flock.count": index % 3 + 1} for index in range(80)]
    vary = {path: [point[path] for point in points] for path in points[0]}
    _, shown = report_of(ordinary(tmp_path, vary=vary, points=points, design="random", seeds=(1,)), ["order"])
    rows = shown.table("parameter", "value")
    assert [row[0] for row in rows] == ["radio.loss"] * 8 + ["robots.flock.count"] * 3
    assert sum(int(row[2]) for row in rows[:8]) == sum(int(row[2]) for row in rows[8:]) == 80
    assert rows[0][1] == "0.000–0.090"


def test_pooled_tables_count_runs_and_seeds(tmp_path):
    vary = {"radio.loss": [index / 100 for index in range(16)], "robots.flock.count": [1, 2, 3, 4, 5]}
    _, shown = report_of(ordinary(tmp_path, vary=vary, seeds=FEW), ["order"])
    rows = shown.table("parameter", "value")
    assert [row[2:4] for row in rows] == [["30", "6"]] * 16 + [["96", "6"]] * 5


def test_runs_that_a_stop_condition_ended_first_have_a_column(tmp_path):
    times = {"slow_s": lambda *_: 60.0}
    _, shown = report_of(ordinary(tmp_path, times=times, stopped={0: 8.5, 1: 20.0}), ["slow_s"])
    rows = shown.table("radio.loss", "n")
    assert [row[-1] for row in rows] == ["2 of 6, from 8.5 s", "–", "–", "–"]


def test_scaling_has_intervals_and_one_restriction_time(tmp_path):
    def time_s(point, rng):
        return float(rng.exponential(100.0 / point["robots.flock.count"]))

    _, shown = report_of(
        ordinary(tmp_path, vary={"robots.flock.count": COUNTS}, seeds=range(30), times={"task_s": time_s})
    )
    rows = shown.table("robots.flock.count", "mean time in s")
    assert rows[0][2:] == ["1.000", "1.000", "–"]
    for row in rows[1:]:
        value, low, high = (float(part) for part in row[2].replace("(", "").replace(")", "").replace("to ", "").split())
        assert low < value < high


def test_numbers_in_the_table_are_those_of_the_runs(tmp_path):
    values = iter([3.0, 1.0, 2.0, 5.0, 4.0, *[7.5] * 5])
    numbers = {"gap_m.final": lambda *_: next(values)}
    _, shown = report_of(
        write_campaign(tmp_path / "a", {"radio.loss": [0.0, 0.5]}, range(5), numbers=numbers, times={})
    )
    [first, second] = shown.table("radio.loss", "n", "median", "quartiles", "95 % interval of the median")
    assert first[:4] == ["0", "5", "3.0", "2.0 to 4.0"]
    assert second == ["0.5", "5", "7.5", "7.5", "7.5"]


def test_quartiles_of_times_beyond_the_limit_say_so(tmp_path):
    arrive = {"early": [10.0] * 8 + [None] * 2, "late": [10.0] * 4 + [None] * 6, "never": [None] * 10}
    drawn = {key: iter(times) for key, times in arrive.items()}
    times = {"found_s": lambda point, _: next(drawn[point["who"]])}
    folder = write_campaign(tmp_path / "a", {"who": list(arrive)}, range(10), numbers={}, times=times, limit_s=120.0)
    sections, shown = report_of(folder)
    cells = {row[0]: row[2:] for row in shown.table("who", "n")}
    assert cells["early"][:2] == ["10", "10"]
    assert cells["late"][:2] == ["> 120 s", "10 to > 120 s"]
    assert cells["never"] == ["> 120 s", "> 120 s", "> 120 s", "100 %"]
    assert [cells[who][3] for who in arrive] == ["20 %", "60 %", "100 %"]
    assert "Transitions" not in sections


def test_limit_of_a_time_is_not_rounded_up_beyond_what_was_observed(tmp_path):
    times = {"found_s": lambda point, _: None if point["who"] == "never" else 2.0}
    folder = write_campaign(tmp_path / "a", {"who": ["soon", "never"]}, range(4), numbers={}, times=times, limit_s=2.6)
    _, shown = report_of(folder)
    assert [row[3] for row in shown.table("who", "n")][-1] == "> 2.6 s"


def test_failed_and_missing_runs_are_told_with_what_to_do(tmp_path):
    folder = ordinary(tmp_path, failed=(3, 4, 20), missing=(7, 8), parts=3)
    _, shown = report_of(folder)
    assert ["runs", "19 done, 3 failed, 2 missing"] in shown.table("scenario")
    assert shown.table("error", "runs") == [["the agent of flock-0 failed", "3", "3", "0, 3"]]
    listings = "\n".join(shown.texts)
    assert f"swarmwire repeat {folder} --run 3" in listings
    assert f"swarmwire sweep --resume {folder}" in listings
    assert [row[1] for row in shown.table("radio.loss", "n")] == ["4", "4", "6", "5"]


def test_ranges_that_points_were_drawn_from_are_told(tmp_path):
    folder = ordinary(tmp_path, design="random")
    about = json.loads((folder / "campaign.json").read_text())
    campaign = {
        "vary": {"radio.loss": {"from": 0, "to": 0.6}},
        "began_utc": "20260102T030405Z",
        "overrides": ["a=1", "b=2"],
    }
    (folder / "campaign.json").write_text(json.dumps(about | campaign))
    _, shown = report_of(folder)
    assert {"from 0 to 0.6", "2026-01-02 03:04 UTC", "a=1, b=2"} <= {row[1] for row in shown.table("scenario")}


def test_seeds_are_told_to_the_last_digit(tmp_path):
    _, shown = report_of(ordinary(tmp_path, seeds=(20240501, 7)), ["order"])
    assert ["seeds", "20240501, 7"] in shown.table("scenario")


@pytest.mark.parametrize(
    ("runs", "titles"), [({"missing": range(24), "parts": 1}, []), ({"failed": range(24)}, ["Summary"])]
)
def test_report_exists_before_any_run_has_ended_and_when_every_run_failed(tmp_path, runs, titles):
    sections, shown = report_of(ordinary(tmp_path, **runs))
    assert list(sections) == [*titles, "Setup", "Methods"]
    assert "failed" not in runs or shown.table("error", "runs")[0][1] == "24"


def test_constant_and_missing_responses_are_left_out_and_named(tmp_path):
    numbers = {
        "order.final": lambda _, rng: rng.random(),
        "components.final": lambda *_: 1.0,
        "gap_m.final": lambda *_: None,
    }
    _, shown = report_of(ordinary(tmp_path, numbers=numbers, times={"never_s": lambda *_: None}))
    text = " ".join(shown.texts)
    assert "Left out (equal in all runs that have a value): components.final ." in text
    assert "Left out (without a value in any run): gap_m.final and never_s ." in text


def test_responses_that_are_listed_are_shown_even_if_constant(tmp_path):
    numbers = {"order.final": lambda _, rng: rng.random(), "components.final": lambda *_: 1.0}
    _, shown = report_of(ordinary(tmp_path, numbers=numbers), ["components", "aggregation_time_s"])
    assert [row[2] for row in shown.table("radio.loss", "n")] == ["1"] * 4
    with pytest.raises(
        BadInput, check=lambda error: error.key == "ordre" and "order (did you mean this?)" in error.expected
    ):
        report_of(tmp_path / "made-up", ["ordre"])


@pytest.mark.parametrize(
    ("shape", "better"), [(lambda f: 1.0 - f, "linear"), (lambda f: np.exp(-4.0 * f), "exponential")]
)
def test_resilience_names_the_better_of_linear_and_exponential(tmp_path, shape, better):
    vary = {"events.0.robots.share": [0.0, 0.2, 0.4, 0.6, 0.8]}
    numbers = {
        "order.final": lambda point, rng: float(shape(point["events.0.robots.share"])) + 0.01 * rng.standard_normal(),
        "wait.final": lambda point, rng: 1.0 + point["events.0.robots.share"] + 0.01 * rng.standard_normal(),
    }
    sections, shown = report_of(ordinary(tmp_path, vary=vary, numbers=numbers, times={}))
    assert [row[2] for row in shown.table("response", "over", "shape") if row[-1] == "better"] == [better]
    assert "`wait.final`" in str(sections["Resilience"].parts[0])


def test_line_has_no_change_point_and_a_cliff_over_loss_is_a_step(tmp_path):
    loss = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
    numbers = {
        "order.final": lambda point, rng: (1.0 if point["radio.loss"] < 0.75 else 0.07) + 0.02 * rng.standard_normal(),
        "radio.link_pdr": lambda point, rng: 1.0 - point["radio.loss"] + 0.01 * rng.standard_normal(),
        "target_best.final": lambda point, rng: 1.0 - 0.1 * point["radio.loss"] + 0.1 * rng.standard_normal(),
    }
    sections, shown = report_of(ordinary(tmp_path, vary={"radio.loss": loss}, numbers=numbers, times={}))
    steps = {row[0]: row[1] for row in shown.table("response", "change point")}
    assert (steps["order.final"], steps["radio.link_pdr"]) == ("0.75", "none")
    fits = {
        row[0]: row for row in shown.table("response", "over", "shape") if "better" in row[-1] or "no worse" in row[-1]
    }
    assert "step at 0.75" in fits["order.final"]
    assert "explains little" in fits["target_best.final"][-1]
    assert "`radio.loss`" in str(sections["Transitions"].parts[0])
    assert "Survival" not in sections


def test_labels_stand_in_figures_and_unknown_ones_are_refused(tmp_path):
    folder = CampaignFolder(ordinary(tmp_path))
    report = campaign_report(folder, ["order"], {"radio.loss": "packet loss", "order": "polarisation"})
    assert all("olarisation" in figure.caption for figure in report.figures)
    plain = campaign_report(folder, ["order"])
    assert all(one.svg != other.svg for one, other in zip(report.figures, plain.figures, strict=True))
    with pytest.raises(BadInput, check=lambda error: error.key == "radio.los" and "radio.loss" in error.expected):
        campaign_report(folder, [], {"radio.los": "x"})


def test_figures_are_files_beside_the_page_as_in_it(tmp_path):
    folder = ordinary(tmp_path)
    report = campaign_report(CampaignFolder(folder), ["order"])
    written = write_report(report, folder / "report.html")
    figures = [folder / "figures" / f"{part.name}.{kind}" for kind in ("svg", "pdf") for part in report.figures]
    assert written == [folder / "report.html", *figures]
    assert all(path.read_bytes().startswith(b"%PDF") for path in figures if path.suffix == ".pdf")
    shown = Page(written[0].read_text(encoding="utf-8"))
    assert shown.images == [path.read_bytes() for path in figures[: len(report.figures)]]
    assert write_report(report, tmp_path / "b.html")[1].parent == tmp_path / "b-figures"


def test_page_of_a_campaign_does_not_grow_with_the_runs(tmp_path):
    def size(seeds):
        folder = write_campaign(tmp_path / str(seeds), {"radio.loss": [0.0, 0.3, 0.6]}, range(seeds))
        return len(page(campaign_report(CampaignFolder(folder), ["order"])))

    assert size(200) < 1.3 * size(50)


@pytest.mark.parametrize(
    ("values", "spreads", "written"),
    [
        ([0.94123, 0.5], [0.051], ["0.941", "0.500"]),
        ([123.456, 7.0], [20.0], ["123", "7"]),
        ([3.0, 12345.0], [], ["3", "12,345"]),
        ([0.5, 12345.678], [], ["0", "12,346"]),
        ([1.5, 2.25], [], ["1.50", "2.25"]),
        ([-0.25, -0.0001], [0.1], ["−0.25", "0.00"]),
        ([1e-9, 3e-9], [], ["1.00e−09", "3.00e−09"]),
        ([2.5e8], [], ["2.50e+08"]),
        ([0.0, 0.0], [0.0], ["0", "0"]),
        ([math.nan, math.inf, 2.5], [math.nan], ["–", "–", "2.50"]),
        ([], [], []),
    ],
)
def test_decimals_follow_the_spread_or_else_the_size(values, spreads, written):
    rounding = rounding_of(values, spreads)
    assert [rounding.text(value) for value in values] == written


def test_numbers_are_in_ascending_order_and_names_as_they_were_asked_for():
    points = tuple({"x": x, "who": who} for x, who in ((0.5, "pso"), (0.1, "flocking"), (0.5, "flocking")))
    numbers, names = levels_of("x", points), levels_of("who", points)
    assert (numbers.labels, numbers.of_point.tolist()) == (("0.1", "0.5"), [1, 0, 1])
    assert (names.labels, names.of_point.tolist(), names.number) == (("pso", "flocking"), [0, 1, 1], None)
    assert numbers.points(1) == [0, 2]


def test_true_and_lists_are_names():
    points = tuple({"x": value} for value in (True, [1, 2.5], None, True))
    levels = levels_of("x", points)
    assert (levels.labels, levels.number) == (("true", "[1, 2.5]", "null"), None)


def test_levels_up_to_the_maximum_stay_apart():
    levels = levels_of("x", tuple({"x": x} for x in range(MAX_LEVELS)))
    assert (len(levels), levels.means) == (MAX_LEVELS, ())


@pytest.mark.parametrize("values", [[x / 100 for x in range(100)], [0.0] * 50 + [x * x for x in range(50)]])
def test_more_values_become_ranges_that_hold_every_point_once(values):
    levels = levels_of("x", tuple({"x": x} for x in values))
    assert levels.number is not None
    points = sorted(point for level in range(len(levels)) for point in levels.points(level))
    assert points == list(range(100))
    assert len(levels) <= 8
    for level, label in enumerate(levels.labels):
        part = [values[point] for point in levels.points(level)]
        low, high = map(float, label.split("–"))
        assert abs(low - min(part)) <= 1.0
        assert abs(high - max(part)) <= 1.0
        assert levels.number[level] == pytest.approx(sum(part) / len(part))
    assert (np.diff(levels.number) > 0.0).all()


def group(values, censored=0.0, quartiles=None):
    values = np.array(values, dtype=float)
    return GroupValues("a", values, censored, quartiles or tuple(np.quantile(values, (0.25, 0.5, 0.75))))


@pytest.mark.parametrize(
    "groups",
    [
        [group([1.0])],
        [group([2.0] * 100), group([1.0, 3.0] * 30)],
        [group([], 0.0, NONE), group([1.0, 2.0])],
        [group([], 1.0, BEYOND), group([5.0], 0.9, BEYOND), group([5.0, 6.0], 0.5, (5.0, 6.0, np.inf))],
        [group(np.geomspace(0.01, 9.0, 200), 0.3)],
    ],
)
@pytest.mark.parametrize("limit", [None, 10.0])
def test_distributions_are_drawn_whether_values_differ_or_are_there_at_all(groups, limit):
    assert svg_of(distributions(groups, "what", "x", limit))


@pytest.mark.parametrize(
    "values", [[0.5, 0.5, 0.5], [np.nan, 1.0, np.inf], [np.nan] * 3, [np.inf] * 3, [1.0, 100.0, 5000.0]]
)
@pytest.mark.parametrize("limit", [None, 9000.0])
@pytest.mark.parametrize("x", [[0.0, 1.0, 2.0], [0.01, 1.0, 200.0]])
def test_responses_are_drawn_with_and_without_a_limit_and_side_by_side(values, limit, x):
    values = np.array(values)
    line = MedianLine("a", np.array(x), values, values, values, values, values, Jump(0.5, 0.5, 1.5))
    assert svg_of(response_curve([line], "what", "x", limit))
    assert svg_of(response_curve([line, line], "what", "x", limit))


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf, -3.0])
@pytest.mark.parametrize("columns", [1, 3, 12])
def test_maps_are_drawn_of_equal_of_no_and_of_censored_medians(value, columns):
    values = np.full((2, columns), value)
    labels = [str(index) for index in range(columns)]
    jumps = [None, Jump(0.5, 0.0, 1.0)]
    assert svg_of(heat_map(HeatMap(values, labels, ["a", "b"], jumps), "what", "x", "y"))


def test_survival_of_nobody_of_all_and_of_thousands():
    nobody = SurvivalCurve("a", np.empty(0), np.empty(0), np.empty(0), 0.0)
    waiting = SurvivalCurve("b", np.empty(0), np.empty(0), np.full(7, 30.0), 30.0)
    many = SurvivalCurve("c", np.arange(1.0, 5001.0), np.linspace(1.0, 0.0, 5000), np.arange(0.5, 5000.0), 5000.0)
    for curves in ([nobody], [waiting], [nobody, waiting, many], [many]):
        assert len(svg_of(survival_curves(curves, "what", "x"))) < 60_000


def test_resilience_and_scaling_are_drawn_of_a_few_points():
    share = np.array([0.0, 0.5])
    shapes = [FittedShape("linear", share, 1.0 - share, best=True)]
    assert svg_of(resilience_curve(share, 1.0 - share, share, share, shapes, "what", "x"))
    robots, value = np.array([5.0, 50.0, 500.0]), np.array([np.nan, 1.0, 2.0])
    assert svg_of(scaling_curve(robots, value, [(1.0, 2.0)] * 3, "what", 1.0))


@pytest.mark.parametrize(
    ("values", "logarithmic"),
    [
        ([1.0, 10.0, 1000.0], True),
        ([0.0, 10.0, 1000.0], False),
        ([1.0, 2.0], False),
        ([], False),
        ([np.nan, 5.0], False),
    ],
)
def test_axis_is_logarithmic_for_positive_values_over_decades(values, logarithmic):
    assert fits_log(np.array(values)) == logarithmic


def test_share_curve_is_drawn_with_its_intervals():
    intervals = [Interval(0.7225, 1.0), Interval(0.2366, 0.7634)]
    axes = share_curve(np.array([0.0, 0.5]), np.array([1.0, 0.5]), intervals, "what", "x").axes[0]
    np.testing.assert_allclose(axes.lines[0].get_xydata(), [[0.0, 1.0], [0.5, 0.5]])
    (drawn,) = axes.collections
    np.testing.assert_allclose(
        [segment[:, 1] for segment in drawn.get_segments()], [[0.7225, 1.0], [0.2366, 0.7634]], atol=1e-4
    )
