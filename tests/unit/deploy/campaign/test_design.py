"""What varies, and the points of designs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.design import Range, points_of, vary_from, vary_of


def values(text):
    found = vary_of(text).values
    return found.values() if isinstance(found, Range) else list(found)


def test_a_range_is_even_and_in_decimals_as_people_write_them():
    assert values("radio.loss=0:0.8:9") == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
    assert values("a.b=1:0:3") == [1.0, 0.5, 0.0]
    assert values("a=-1e-3:1e-3:2") == [-0.001, 0.001]
    assert values("a=5:9:1") == [5.0]


def test_a_range_in_equal_ratios():
    assert values("a=1:10000:5:log") == [1.0, 10.0, 100.0, 1000.0, 10000.0]
    assert values("a=1e-300:1e300:3:log") == [1e-300, 1.0, 1e300]
    assert values("a=1e-999999999:2:3") == [0.0, 1.0, 2.0]


@given(st.integers(-1000, 1000), st.integers(1, 1000), st.integers(2, 50))
def test_a_range_begins_and_ends_as_asked_and_rises(first, width, count):
    found = values(f"a={first}:{first + width}:{count}")
    assert (found[0], found[-1], len(found)) == (first, first + width, count)
    assert found == sorted(set(found))


def test_lists_are_toml_values_and_what_is_none_is_a_text():
    assert values("a=5,10,20") == [5, 10, 20]
    assert values("a=0.5,2,true") == [0.5, 2, True]
    assert values("a=[4, 4], [8, 8]") == [[4, 4], [8, 8]]
    assert values("a=discs,pymunk") == ["discs", "pymunk"]
    assert values('a="x,y",z') == ['"x', 'y"', "z"]
    assert values("robots.pair.agent=a.py:A,b.py:B") == ["a.py:A", "b.py:B"]
    assert values("a=7") == [7]


def test_tables_and_lists_of_a_file_say_the_same():
    table = {"from": 0.0, "to": 0.8, "count": 9}
    assert vary_from("radio.loss", table, "x").values == vary_of("radio.loss=0:0.8:9").values
    assert vary_from("a", {"from": 1, "to": 100, "scale": "log"}, "x").values == vary_of("a=1:100:log").values
    assert vary_from("a", [1, 2], "x").values == (1, 2)
    assert vary_from("a", "1:3:3", "x").values == vary_of("a=1:3:3").values


@pytest.mark.parametrize(
    "text",
    ["radio.loss", "=1", "a.=1", "a=", "a=0:1:x", "a=0:", "a=0:1:2:3", "a=0:1:2:log:3", "a=1:2:0", "a=1:1:2",
     "a=0:1:2:log", "a=1,1", "a=1:2:1000000000", "a=0:1e400:3", "a=0:1e999999999:3", "a=1:inf:3"],
)  # fmt: skip
def test_what_is_none_of_it_is_refused_by_its_name(text):
    with pytest.raises(BadInput) as refused:
        vary_of(text)
    assert (refused.value.where, refused.value.expected.startswith("expected ")) == (f"--vary {text}", True)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "given", [{"from": 0}, {"from": 0, "to": 1, "cuont": 3}, {"from": 0, "to": 1, "count": 1.5}, 3, []]
)
def test_what_a_file_says_wrongly_is_refused(given):
    with pytest.raises(BadInput, match="^there: expected "):
        vary_from("a", given, "there")


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
