"""The report of a campaign, of every kind of design, has what it should, with the right numbers."""

import json

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.campaign.folder import CampaignFolder
from swarmwire.metrics.report.campaign import campaign_report
from swarmwire.metrics.report.page import page, write_report
from tests.support.metrics.campaign.campaigns import write_campaign
from tests.support.metrics.report.pages import Page, check_alone

pytest.importorskip("matplotlib", reason="needs the extra [report]")
LOSS = [0.0, 0.2, 0.4, 0.6]
COUNTS = [5, 10, 20]
FEW = (1, 2, 3, 4, 5, 6)


def of(folder, responses=()):
    """The report's sections by title, and its page."""
    report = campaign_report(CampaignFolder(folder), responses)
    return {section.title: section for section in report.sections}, Page(page(report))


def ordinary(tmp_path, **differently):
    return write_campaign(tmp_path / "made-up", **{"vary": {"radio.loss": LOSS}, "seeds": FEW, **differently})


def test_one_parameter_has_curves_and_no_map(tmp_path):
    sections, shown = of(ordinary(tmp_path))
    assert list(sections) == [
        *("What was run", "Summary", "Distributions", "Transitions", "Survival", "Resilience", "Methods")
    ]
    names = [figure.name for section in sections.values() for figure in section.parts if hasattr(figure, "svg")]
    assert {"distribution-aggregation_time_s-radio.loss", "response-order.final-radio.loss"} < set(names)
    assert {"survival-aggregation_time_s-radio.loss", "resilience-order.final-radio.loss"} < set(names)
    assert not any(name.startswith("map") for name in names)
    assert shown.tags.count("figure") == len(names)
    check_alone(shown)


def test_two_parameters_have_maps_and_robots_have_scaling(tmp_path):
    vary = {"radio.loss": LOSS, "robots.flock.count": COUNTS}
    sections, shown = of(ordinary(tmp_path, vary=vary, seeds=(1, 2, 3)), ["order", "aggregation_time_s"])
    maps = [part for part in sections["Transitions"].parts if hasattr(part, "svg")]
    assert [part.name for part in maps] == [
        f"map-{response}-radio.loss-robots.flock.count" for response in ("order.final", "aggregation_time_s")
    ]
    assert len(shown.table("response", "at")) == 2 * len(COUNTS)
    assert [row[0] for row in shown.table("robots.flock.count", "mean time in s")] == ["5", "10", "20"]
    check_alone(shown)


def test_names_beside_a_number_are_told_apart(tmp_path):
    vary = {"radio.loss": LOSS, "robots.flock.agent": ["flocking", "pso"]}
    sections, shown = of(ordinary(tmp_path, vary=vary, seeds=(1, 2, 3)), ["order"])
    assert [row[1] for row in shown.table("response", "at")] == [
        "robots.flock.agent flocking",
        "robots.flock.agent pso",
    ]
    assert len([part for part in sections["Distributions"].parts if hasattr(part, "svg")]) == 2


def test_three_numbers_are_drawn_in_pairs(tmp_path):
    vary = {"a.x": [0, 1, 2], "a.y": [1, 2], "a.z": [3, 4, 5]}
    sections, _ = of(ordinary(tmp_path, vary=vary, seeds=(1, 2)), ["order"])
    names = [part.name for part in sections["Transitions"].parts if hasattr(part, "svg")]
    assert names == [f"map-order.final-{pair}" for pair in ("a.x-a.y", "a.x-a.z", "a.y-a.z")]


def test_a_single_point_has_a_table_and_survival_alone(tmp_path):
    sections, shown = of(ordinary(tmp_path, vary={}, points=[{}]))
    assert list(sections) == ["What was run", "Summary", "Survival", "Methods"]
    assert shown.table("n", "median")[0][0] == "6"


def test_many_points_are_put_together_into_ranges(tmp_path):
    points = [{"radio.loss": place / 100, "robots.flock.count": place % 3 + 1} for place in range(80)]
    vary = {path: [point[path] for point in points] for path in points[0]}
    _, shown = of(ordinary(tmp_path, vary=vary, points=points, design="random", seeds=(1,)), ["order"])
    rows = shown.table("parameter", "value")
    assert [row[0] for row in rows] == ["radio.loss"] * 8 + ["robots.flock.count"] * 3
    assert sum(int(row[2]) for row in rows[:8]) == sum(int(row[2]) for row in rows[8:]) == 80
    assert rows[0][1] == "0.000–0.090"


def test_numbers_in_the_table_are_those_of_the_runs(tmp_path):
    values = iter([3.0, 1.0, 2.0, 5.0, 4.0, *[7.5] * 5])
    numbers = {"gap_m.final": lambda *_: next(values)}
    _, shown = of(write_campaign(tmp_path / "a", {"radio.loss": [0.0, 0.5]}, range(5), numbers=numbers, times={}))
    [first, second] = shown.table("radio.loss", "n", "median", "quartiles", "95 % interval of the median")
    assert first[:4] == ["0", "5", "3.0", "2.0 to 4.0"]
    assert second == ["0.5", "5", "7.5", "7.5", "7.5"]


def test_quartiles_of_times_beyond_the_limit_say_so(tmp_path):
    arrive = {"early": [10.0] * 8 + [None] * 2, "late": [10.0] * 4 + [None] * 6, "never": [None] * 10}
    drawn = {key: iter(times) for key, times in arrive.items()}
    times = {"found_s": lambda point, _: next(drawn[point["who"]])}
    folder = write_campaign(tmp_path / "a", {"who": list(arrive)}, range(10), numbers={}, times=times, limit_s=120.0)
    sections, shown = of(folder)
    cells = {row[0]: row[2:] for row in shown.table("who", "n")}
    assert cells["early"][:2] == ["10", "10"]
    assert cells["late"][:2] == ["> 120 s", "10 to > 120 s"]
    assert cells["never"] == ["> 120 s", "> 120 s", "> 120 s", "100 %"]
    assert [cells[who][3] for who in arrive] == ["20 %", "60 %", "100 %"]
    assert "Transitions" not in sections


def test_a_limit_is_never_rounded_up_to_what_nobody_watched(tmp_path):
    times = {"found_s": lambda point, _: None if point["who"] == "never" else 2.0}
    folder = write_campaign(tmp_path / "a", {"who": ["soon", "never"]}, range(4), numbers={}, times=times, limit_s=2.6)
    _, shown = of(folder)
    assert [row[3] for row in shown.table("who", "n")][-1] == "> 2.6 s"


def test_without_times_nothing_is_said_of_survival(tmp_path):
    sections, shown = of(ordinary(tmp_path, times={}))
    assert "Survival" not in sections
    assert not any("Kaplan" in text for text in shown.said)


def test_failed_and_missing_runs_are_told_with_what_to_do(tmp_path):
    folder = ordinary(tmp_path, failed=(3, 4, 20), missing=(7, 8), parts=3)
    _, shown = of(folder)
    assert ["runs", "19 done, 3 failed, 2 missing"] in shown.tables[0]
    assert shown.table("error", "runs") == [["the agent of flock-0 failed", "3", "3", "0, 3"]]
    listings = "\n".join(shown.said)
    assert f"swarmwire repeat {folder} --run 3" in listings
    assert f"swarmwire sweep --resume {folder}" in listings
    assert [row[1] for row in shown.table("radio.loss", "n")] == ["4", "4", "6", "5"]


def test_ranges_that_points_were_drawn_from_are_told(tmp_path):
    folder = ordinary(tmp_path, design="random")
    about = json.loads((folder / "campaign.json").read_text())
    told = {
        "vary": {"radio.loss": {"from": 0, "to": 0.6}},
        "began_utc": "20260102T030405Z",
        "overrides": ["a=1", "b=2"],
    }
    (folder / "campaign.json").write_text(json.dumps(about | told))
    _, shown = of(folder)
    assert {"from 0 to 0.6", "2026-01-02 03:04 UTC", "a=1, b=2"} <= {row[1] for row in shown.tables[0]}


def test_seeds_are_told_to_the_last_digit(tmp_path):
    _, shown = of(ordinary(tmp_path, seeds=(20240501, 7)), ["order"])
    assert ["seeds", "20240501, 7"] in shown.tables[0]


def test_before_any_run_has_ended_there_is_a_report_all_the_same(tmp_path):
    sections, _ = of(ordinary(tmp_path, missing=range(24), parts=1))
    assert list(sections) == ["What was run", "Methods"]


def test_when_every_run_failed_there_is_a_report_all_the_same(tmp_path):
    sections, shown = of(ordinary(tmp_path, failed=range(24)))
    assert shown.table("error", "runs")[0][1] == "24"
    assert "Transitions" not in sections


def test_what_does_not_vary_or_never_came_is_left_out_and_named(tmp_path):
    numbers = {
        "order.final": lambda _, rng: rng.random(),
        "components.final": lambda *_: 1.0,
        "gap_m.final": lambda *_: None,
    }
    _, shown = of(ordinary(tmp_path, numbers=numbers, times={"never_s": lambda *_: None}))
    said = " ".join(shown.said)
    assert "left out: components.final ." in said
    assert "left out: gap_m.final and never_s ." in said


def test_what_is_asked_for_is_shown_even_if_it_never_varies(tmp_path):
    numbers = {"order.final": lambda _, rng: rng.random(), "components.final": lambda *_: 1.0}
    _, shown = of(ordinary(tmp_path, numbers=numbers), ["components", "aggregation_time_s"])
    assert [row[2] for row in shown.table("radio.loss", "n")] == ["1"] * 4
    with pytest.raises(BadInput, check=lambda error: error.key == "ordre" and "order.final" in error.expected):
        of(tmp_path / "made-up", ["ordre"])


def test_a_jump_is_found_where_it_is(tmp_path):
    step = {"order.final": lambda point, rng: float(point["radio.loss"] < 0.3) + 0.05 * rng.standard_normal()}
    _, shown = of(ordinary(tmp_path, numbers=step, times={}))
    assert [row[1] for row in shown.table("response", "change point")] == ["0.3"]


@pytest.mark.parametrize(
    ("shape", "better"), [(lambda f: 1.0 - f, "linear"), (lambda f: np.exp(-4.0 * f), "exponential")]
)
def test_the_shape_of_what_is_left_is_named(tmp_path, shape, better):
    vary = {"events.0.robots.share": [0.0, 0.2, 0.4, 0.6, 0.8]}
    numbers = {
        "order.final": lambda point, rng: float(shape(point["events.0.robots.share"])) + 0.01 * rng.standard_normal(),
        "wait.final": lambda point, rng: 1.0 + point["events.0.robots.share"] + 0.01 * rng.standard_normal(),
    }
    sections, shown = of(ordinary(tmp_path, vary=vary, numbers=numbers, times={}))
    assert [row[2] for row in shown.table("response", "over", "shape") if row[-1] == "better"] == [better]
    assert "`wait.final`" in str(sections["Resilience"].parts[0])


def test_a_scenario_may_be_called_anything(tmp_path):
    _, shown = of(ordinary(tmp_path, name="<script>alert(1)</script> & co"))
    assert "<script>alert(1)</script> & co" in shown.said
    check_alone(shown)


def test_figures_are_files_beside_the_page_as_in_it(tmp_path):
    folder = ordinary(tmp_path)
    report = campaign_report(CampaignFolder(folder), ["order"])
    written = write_report(report, folder / "report.html")
    assert written == [folder / "report.html", *(folder / "figures" / f"{part.name}.svg" for part in report.figures)]
    text = written[0].read_text(encoding="utf-8")
    for path in written[1:]:
        body = path.read_text(encoding="utf-8").partition("<svg ")[2].strip()
        assert body.removesuffix("</svg>") in text, path
    assert write_report(report, tmp_path / "b.html")[1].parent == tmp_path / "b-figures"


def test_a_page_does_not_grow_with_the_runs(tmp_path):
    def size(seeds):
        folder = write_campaign(tmp_path / str(seeds), {"radio.loss": [0.0, 0.3, 0.6]}, range(seeds))
        return len(page(campaign_report(CampaignFolder(folder), ["order"])))

    assert size(200) < 1.3 * size(50)
