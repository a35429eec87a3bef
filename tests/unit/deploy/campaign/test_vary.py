"""What `--vary` says, and says wrongly."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.design import Range, vary_from, vary_of


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
