"""What `--search` says, and says wrongly."""

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.tuning.spec import Search, fresh_seeds, search_from, search_of


def search(text, whole=False):
    return search_from(search_of(text), lambda _: whole)


def test_a_range_holds_numbers_whole_ones_where_the_scenarios_are():
    assert search("radio.loss=0:0.8") == Search("radio.loss", 0.0, 0.8)
    assert search("a.b=1:100:log") == Search("a.b", 1.0, 100.0, log=True)
    assert search("a=2:9.6", whole=True) == Search("a", 2.0, 10.0, whole=True)
    assert search("a=2:9", whole=True).trials == (2, 9)
    assert search("a=0.02:0.2").override(0.1) == "a=0.1"


def test_choices_are_toml_values_known_by_their_texts():
    found = search("a=[4.0, 4.0],[8.0, 8.0]")
    assert found.names == ("[4.0, 4.0]", "[8.0, 8.0]")
    assert found.value("[8.0, 8.0]") == [8.0, 8.0]
    assert search("a=discs,pymunk").value("pymunk") == "pymunk"
    assert search("a=0.5,2,true").choices == (0.5, 2, True)


@pytest.mark.parametrize(
    "text",
    ["radio.loss", "=1", "a=", "a=0:1:5", "a=0:1:5:log", "a=0:", "a=1:1", "a=2:1", "a=0:1:log", "a=1,1", "a='1',1"],
)
def test_what_is_none_of_it_is_refused_by_its_name(text):
    with pytest.raises(BadInput) as refused:
        search(text)
    assert refused.value.where == f"--search {text}"
    assert "\n" not in str(refused.value)
    assert "COUNT" not in str(refused.value)


@pytest.mark.parametrize("text", ["a=1.1:1.2", "a=0.2:3:log"])
def test_a_range_without_whole_numbers_is_refused_where_these_are_wanted(text):
    with pytest.raises(BadInput, match=f"^--search {text}: expected LOW"):
        search(text, whole=True)


def test_fresh_seeds_are_none_of_those_used():
    assert fresh_seeds("3", (1, 2, 5)) == (6, 7, 8)
    assert fresh_seeds("10:12", (1, 2, 5)) == (10, 11)
    assert fresh_seeds("3,4", (1, 2, 5)) == (3, 4)
    for text, used in (("5:9", (1, 2, 5)), ("0", (1, 2, 5)), ("x", (1, 2, 5)), ("2", (2**63 - 1,))):
        with pytest.raises(BadInput) as refused:
            fresh_seeds(text, used)
        assert refused.value.where == "--check-seeds"
