import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.seed_list import chosen_seeds, seed_list


def test_seeds_are_a_number_a_range_or_a_list():
    assert seed_list("3") == seed_list(3) == (1, 2, 3)
    assert seed_list("4:7") == (4, 5, 6)
    assert seed_list("7,1,5") == seed_list([7, 1, 5]) == (7, 1, 5)
    assert seed_list("5,") == (5,)


def test_of_seeds_that_are_chosen_a_number_is_one():
    assert chosen_seeds("7", "--record-seeds") == (7,)
    assert chosen_seeds("2:4", "--record-seeds") == chosen_seeds([2, 3], "--record-seeds") == (2, 3)


@pytest.mark.parametrize(
    "given", ["0", "", "x", "5:5", "1,1", "-1,2", "1:99999999999999999999", "9" * 30, [], [1.5], "0.5"]
)
def test_what_gives_no_seeds_is_refused_by_its_name(given):
    with pytest.raises(BadInput, match="^--seeds: expected "):
        seed_list(given)
