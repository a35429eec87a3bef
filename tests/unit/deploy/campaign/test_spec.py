"""What varies, the points of designs, and campaigns, which are checked at the door at each of their points."""

import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.deploy.campaigns.design import ParameterRange, points_of, toml_value, vary_from, vary_of
from swarmwire.deploy.campaigns.spec import SweepSpec, plan_of
from tests.support.refusals import refused_input


def values(text):
    variation = vary_of(text).values
    return variation.values() if isinstance(variation, ParameterRange) else list(variation)


def test_range_is_evenly_spaced_in_short_decimals():
    assert values("radio.loss=0:0.8:9") == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
    assert values("a.b=1:0:3") == [1.0, 0.5, 0.0]
    assert values("a=-1e-3:1e-3:2") == [-0.001, 0.001]
    assert values("a=5:9:1") == [5.0]


def test_range_with_log_has_equal_ratios():
    assert values("a=1:10000:5:log") == [1.0, 10.0, 100.0, 1000.0, 10000.0]
    assert values("a=1e-300:1e300:3:log") == [1e-300, 1.0, 1e300]
    assert values("a=1e-999999999:2:3") == [0.0, 1.0, 2.0]


@given(st.integers(-1000, 1000), st.integers(1, 1000), st.integers(2, 50))
def test_range_rises_from_its_first_to_its_last_value(first, width, count):
    numbers = values(f"a={first}:{first + width}:{count}")
    assert (numbers[0], numbers[-1], len(numbers)) == (first, first + width, count)
    assert numbers == sorted(set(numbers))


def test_lists_are_toml_values_and_what_is_none_is_a_text():
    assert values("a=5,10,20") == [5, 10, 20]
    assert values("a=0.5,2,true") == [0.5, 2, True]
    assert values("a=[4, 4], [8, 8]") == [[4, 4], [8, 8]]
    assert values("a=discs,pymunk") == ["discs", "pymunk"]
    assert values('a="x,y",z') == ['"x', 'y"', "z"]
    assert values("robots.pair.agent=a.py:A,b.py:B") == ["a.py:A", "b.py:B"]
    assert values("a=7") == [7]


def test_toml_value_is_read_back_whatever_characters_a_text_has():
    text = 'a "flock" \\ \N{SLIGHTLY SMILING FACE} \x7f\t\u00e9'
    assert tomllib.loads(f"value = {toml_value({text: [text]})}") == {"value": {text: [text]}}


def test_tables_and_lists_of_a_file_say_the_same():
    table = {"from": 0.0, "to": 0.8, "count": 9}
    assert vary_from("radio.loss", table, "x").values == vary_of("radio.loss=0:0.8:9").values
    assert vary_from("a", {"from": 1, "to": 100, "scale": "log"}, "x").values == vary_of("a=1:100:log").values
    assert vary_from("a", [1, 2], "x").values == (1, 2)
    assert vary_from("a", "1:3:3", "x").values == vary_of("a=1:3:3").values


@pytest.mark.parametrize(
    "text",
    ["radio.loss", "=1", "a.=1", "a=", "a=0:1:x", "a=0:", "a=0:1:2:3", "a=0:1:2:log:3", "a=1:2:0", "a=1:1:2",
     "a=0:1:2:log", "a=1:2:1000000000", "a=0:1e400:3", "a=0:1e999999999:3", "a=1:inf:3"],
)  # fmt: skip
def test_vary_text_that_is_no_list_or_range_is_refused(text):
    with refused_input(f"--vary {text}"):
        vary_of(text)


@pytest.mark.parametrize(
    "value", [{"from": 0}, {"from": 0, "to": 1, "cuont": 3}, {"from": 0, "to": 1, "count": 1.5}, 3, []]
)
def test_vary_value_of_a_file_that_cannot_be_is_refused(value):
    with refused_input("there"):
        vary_from("a", value, "there")


def points(kind, *texts, count=None, seed=1, integers=()):
    return points_of(kind, [vary_of(text) for text in texts], count, seed, lambda path: path in integers)


def test_grid_combines_all_values_and_varies_the_last_path_fastest():
    assert points("grid", "a=1,2", "b=x,y") == [
        {"a": 1, "b": "x"}, {"a": 1, "b": "y"}, {"a": 2, "b": "x"}, {"a": 2, "b": "y"}
    ]  # fmt: skip
    assert points("grid") == [{}]
    assert points("grid", "a={},{c=1}", "a.b=1") == [{"a": {}, "a.b": 1}, {"a": {"c": 1}, "a.b": 1}]


def test_list_design_pairs_values_one_to_one():
    assert points("list", "a=1,2", "b=0:1:2") == [{"a": 1, "b": 0.0}, {"a": 2, "b": 1.0}]
    assert points("list", "a=0.5,0.7", "b=2,2") == [{"a": 0.5, "b": 2}, {"a": 0.7, "b": 2}]


def test_ranges_over_whole_numbers_are_rounded():
    assert points("grid", "a=5:20:3", integers=["a"]) == [{"a": 5}, {"a": 13}, {"a": 20}]
    assert points("grid", "a=1:100:3:log", integers=["a"]) == [{"a": 1}, {"a": 10}, {"a": 100}]


@given(st.integers(1, 40), st.integers(0, 9))
def test_latin_hypercube_has_one_value_in_each_slice_of_a_range(count, seed):
    rows = points("latin", "a=0:1", "b=-5:5", count=count, seed=seed)
    for path, low, width in (("a", 0, 1), ("b", -5, 10)):
        slices = [int((point[path] - low) / width * count) for point in rows]
        assert sorted(slices) == list(range(count))


@given(st.sampled_from(["random", "latin"]), st.integers(0, 5))
def test_drawn_points_lie_within_their_ranges_and_depend_on_the_seed_alone(kind, seed):
    texts = ("a=-1:2", "b=1:1000:log", "n=3:7", "w=x,y")
    rows = points(kind, *texts, count=60, seed=seed, integers=["n"])
    assert rows == points(kind, *texts, count=60, seed=seed, integers=["n"])
    assert rows != points(kind, *texts, count=60, seed=seed + 1, integers=["n"])
    assert all(-1 <= point["a"] <= 2 and 1 <= point["b"] <= 1000 for point in rows)
    assert {type(point["n"]) for point in rows} == {int}
    assert {point["n"] for point in rows} == {3, 4, 5, 6, 7}
    assert {point["w"] for point in rows} == {"x", "y"}


def test_random_draws_of_a_path_do_not_depend_on_what_else_varies():
    alone = [point["a"] for point in points("random", "a=0:1", count=9)]
    assert alone == [point["a"] for point in points("random", "b=0:1", "a=0:1", count=9)]


def test_random_draws_are_uniform_also_in_equal_ratios():
    drawn = points("random", "a=0:1", "b=1:100:log", count=4000)
    assert np.mean([point["a"] for point in drawn]) == pytest.approx(0.5, abs=0.02)  # 4 sigma of a mean of 4,000
    assert np.mean(np.log10([point["b"] for point in drawn])) == pytest.approx(1.0, abs=0.04)


@pytest.mark.parametrize(
    ("kind", "texts", "count", "message"),
    [
        ("gird", ["a=1,2"], None, "design: .*grid"),
        ("grid", ["a=0:1"], None, "--vary a=0:1: expected FIRST:LAST:COUNT"),
        ("grid", ["a=1,2", "a=3"], None, "--vary a=3: .*once"),
        ("grid", ["a.b=1,2", "a={},{c=1}"], None, "--vary a={},{c=1}: .*before a.b"),
        ("grid", ["a=1,2"], 3, "points: "),
        ("grid", ["n=1:3:9"], None, "--vary n=1:3:9: .*COUNT"),
        ("grid", ["a=1:999:999", "b=1:999:999"], None, "vary: .*100000"),
        ("list", [], None, "design: .*empty"),
        ("list", ["a=1,1", "b=2,2"], None, "vary: .*more than once"),
        ("grid", ["a=1,1", "b=2,3"], None, "--vary a=1,1: .*twice"),
        ("random", ["a=1,1", "b=2,3"], 5, "--vary a=1,1: .*twice"),
        ("list", ["a=1,2", "b=1,2,3"], None, "--vary b=1,2,3: .*2 values.* 3"),
        ("random", [], 5, "design: .*empty"),
        ("random", ["a=0:1"], None, "points: expected 1 to"),
        ("latin", ["a=0:1"], 0, "points: expected 1 to"),
        ("latin", ["a=0:1:5"], 5, "--vary a=0:1:5: .*without COUNT"),
    ],
)
def test_design_that_cannot_be_is_refused(kind, texts, count, message):
    with refused_input(match=f"^{message}"):
        points(kind, *texts, count=count, integers=["n"])


def plan(scenario, *texts, **options):
    return plan_of(SweepSpec(scenario, (1, 2), tuple(vary_of(text) for text in texts), **options))


def test_range_over_integer_keys_of_a_scenario_gives_integers(scenario):
    (scenario.parent / "counting.py").write_text(
        "from swarmwire.agent import Agent\nclass Counting(Agent):\n    n: int = 3\n    x: float = 1.0\n"
        "    def step(self, robot): pass\n"
    )
    agent = (
        'robots.pair.agent="counting.py:Counting"',
        'events=[{at_s=0.1, do="kill", robots={group="pair", count=1}}]',
    )
    campaign = plan(
        scenario, "robots.pair.count=2:8:2", "robots.pair.params.n=1:3:2", "robots.pair.params.x=1:3:2",
        "time.rate_hz=10:20:2", "duration_s=1:2:2", "events.0.robots.count=1:2:2", overrides=agent,
    )  # fmt: skip
    assert [type(value) for value in campaign.points[0].values()] == [int, int, float, int, float, int]
    assert len(campaign.points) == 64


def test_responses_are_told_with_unit_and_kind(scenario):
    responses = {response.column: response for response in plan(scenario).responses}
    assert responses["min_gap.final"].unit == "m"
    assert {response.kind for response in responses.values()} == {"number"}
    assert list(responses)[:4] == ["order.final", "order.mean", "order.min", "order.max"]
    assert "radio.link_pdr" in responses


def test_stop_time_response_names_its_condition_and_hold_time(scenario):
    stop = ('stop={metric="order", at_least=0.5, hold_s=2.0}',)
    for varied, hold_s, condition in (([], 2.0, "order at least 0.5 for 2 s"), (["stop.hold_s=1.0,3.0"], 3.0, "")):
        responses = {response.column: response for response in plan(scenario, *varied, overrides=stop).responses}
        assert responses["stop_time_s"].hold_s == hold_s
        assert condition in responses["stop_time_s"].help


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (["radio.losss=0,0.5"], r"--vary radio.losss=0,0.5: radio.losss: unknown key; .*loss \(did you mean this"),
        (["robots.pair.params.sepa=1,2"], r"--vary robots.pair.params.sepa=1,2: .*sepa: "),
        (["robots.par.count=1,2"], r"--vary robots.par.count=1,2: robots.par.body: "),
        (["robots.pair.count.x=1,2"], r"--vary robots.pair.count.x=1,2: .*robots.pair.count"),
        (["radio.loss=0.5,1.5"], r"--vary radio.loss=0.5,1.5: radio.loss: expected .*got 1.5"),
        (["robots.pair.agent=no.py:No"], r"--vary robots.pair.agent=no.py:No: robots.pair.agent: "),
        (["events.0.at_s=1,2"], r"--vary events.0.at_s=1,2: "),
        (["time.rate_hz=1,10"], r"--vary time.rate_hz=1: physics.steps: "),
        (["seed=1,2"], r"--vary seed=1,2: "),
    ],
)  # fmt: skip
def test_point_that_cannot_be_run_is_refused_with_what_varies(scenario, texts, message):
    with refused_input(match=f"^{message}"):
        plan(scenario, *texts)


@pytest.mark.parametrize(
    ("changed", "where", "key"),
    [
        ({"record_seeds": (3,)}, "record_seeds", ""),
        ({"batch": 0}, "batch", ""),
        ({"overrides": ("radio.los=1",)}, "--set radio.los=1", "radio.los"),
        ({"overrides": ("radio.range_m=1",)}, "--set radio.range_m=1", "radio.range_m"),  # which varies
        ({"overrides": (" radio.range_m = 1",)}, "--set  radio.range_m = 1", "radio.range_m"),
    ],
)
def test_other_arguments_are_checked_too(scenario, changed, where, key):
    with refused_input(where, key):
        plan(scenario, "radio.range_m=1,2", **changed)
