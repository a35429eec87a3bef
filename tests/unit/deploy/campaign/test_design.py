"""The points of a design."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.design import points_of, vary_of


def points(kind, *texts, count=None, seed=1, whole=()):
    return points_of(kind, [vary_of(text) for text in texts], count, seed, lambda path: path in whole)


def test_a_grid_combines_all_the_last_path_the_fastest():
    assert points("grid", "a=1,2", "b=x,y") == [
        {"a": 1, "b": "x"}, {"a": 1, "b": "y"}, {"a": 2, "b": "x"}, {"a": 2, "b": "y"}
    ]  # fmt: skip
    assert points("grid") == [{}]


def test_a_list_takes_values_one_to_one():
    assert points("list", "a=1,2", "b=0:1:2") == [{"a": 1, "b": 0.0}, {"a": 2, "b": 1.0}]


def test_ranges_over_whole_numbers_are_rounded():
    assert points("grid", "a=5:20:3", whole=["a"]) == [{"a": 5}, {"a": 13}, {"a": 20}]
    assert points("grid", "a=1:100:3:log", whole=["a"]) == [{"a": 1}, {"a": 10}, {"a": 100}]


@given(st.integers(1, 40), st.integers(0, 9))
def test_a_latin_hypercube_has_one_value_in_each_slice_of_each_range(count, seed):
    found = points("latin", "a=0:1", "b=-5:5", count=count, seed=seed)
    for path, low, width in (("a", 0, 1), ("b", -5, 10)):
        slices = [int((point[path] - low) / width * count) for point in found]
        assert sorted(slices) == list(range(count))


@given(st.sampled_from(["random", "latin"]), st.integers(0, 5))
def test_drawn_points_lie_within_their_ranges_and_depend_on_the_seed_alone(kind, seed):
    asked = ("a=-1:2", "b=1:1000:log", "n=3:7", "w=x,y")
    found = points(kind, *asked, count=60, seed=seed, whole=["n"])
    assert found == points(kind, *asked, count=60, seed=seed, whole=["n"])
    assert found != points(kind, *asked, count=60, seed=seed + 1, whole=["n"])
    assert all(-1 <= point["a"] <= 2 and 1 <= point["b"] <= 1000 for point in found)
    assert {type(point["n"]) for point in found} == {int}
    assert {point["n"] for point in found} == {3, 4, 5, 6, 7}
    assert {point["w"] for point in found} == {"x", "y"}


def test_random_draws_of_a_path_do_not_depend_on_what_else_varies():
    alone = [point["a"] for point in points("random", "a=0:1", count=9)]
    assert alone == [point["a"] for point in points("random", "b=0:1", "a=0:1", count=9)]


def test_random_draws_are_uniform_also_in_equal_ratios():
    drawn = points("random", "a=0:1", "b=1:100:log", count=4000)
    assert np.mean([point["a"] for point in drawn]) == pytest.approx(0.5, abs=0.02)  # 4 sigma of a mean of 4,000
    assert np.mean(np.log10([point["b"] for point in drawn])) == pytest.approx(1.0, abs=0.04)


@pytest.mark.parametrize(
    ("kind", "texts", "count", "told"),
    [
        ("gird", ["a=1,2"], None, "--design: .*grid"),
        ("grid", ["a=0:1"], None, "--vary a=0:1: expected FIRST:LAST:COUNT"),
        ("grid", ["a=1,2", "a=3"], None, "--vary a=3: .*once"),
        ("grid", ["a=1,2"], 3, "--points: "),
        ("grid", ["n=1:3:9"], None, "--vary n=1:3:9: .*COUNT"),
        ("grid", ["a=1:999:999", "b=1:999:999"], None, "--vary: .*100000"),
        ("list", [], None, "--design: .*empty"),
        ("list", ["a=1,2", "b=1,2,3"], None, "--vary b=1,2,3: .*2 values.* 3"),
        ("random", [], 5, "--design: .*empty"),
        ("random", ["a=0:1"], None, "--points: expected 1 to"),
        ("latin", ["a=0:1"], 0, "--points: expected 1 to"),
        ("latin", ["a=0:1:5"], 5, "--vary a=0:1:5: .*without COUNT"),
    ],
)
def test_a_design_that_is_none_is_refused(kind, texts, count, told):
    with pytest.raises(BadInput, match=f"^{told}"):
        points(kind, *texts, count=count, whole=["n"])
