"""What an event cannot do is refused by its name, and what it is is told as a scenario would say it."""

import numpy as np
import pytest

from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.event import as_toml
from swarmwire.comms.events.ramp import Ramp
from swarmwire.comms.events.revive import Revive
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Swarm

SWARM = Swarm({"a": range(2)}, 2, np.array([7], np.uint64), np.zeros((2, 3)))


def test_an_event_that_lasts_for_ever_or_does_not_change_by_itself_says_so() -> None:
    revive = Revive(at_s=1.0, robots=Selection(group="a"))
    with pytest.raises(TypeError, match="revive lasts for ever: there is nothing to undo"):
        revive.end(0, Conditions(2))
    with pytest.raises(TypeError, match="ramp does not change by itself"):
        Ramp(at_s=1.0, what="radio.loss", to=0.5).go_on(0, 0, SWARM, Conditions(2))


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (True, "true"),
        (False, "false"),
        ("a", '"a"'),
        (0.5, "0.5"),
        ((1, "a"), '[1, "a"]'),
        (Selection(names=("a-0", "a-1")), '{ names = ["a-0", "a-1"] }'),
    ],
)
def test_values_are_told_as_toml(value: object, words: str) -> None:
    assert as_toml(value) == words
