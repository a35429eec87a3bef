"""The scenario's entries about existing network namespaces, and the robots that they name."""

from dataclasses import replace

import pytest

from swarmwire.comms.observe.truth import Group, Static
from swarmwire.comms.radio.config.radio import Interface
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.world.interfaces.joining import joins_of
from tests.support.metrics.truths import static
from tests.support.refusals import refused_input

KEY = "radio.interface.join"


@pytest.fixture
def robots() -> Static:
    """Two robots of a group "rover", then three of a group "drone"."""
    body = load_body("epuck")
    names = ("rover-0", "rover-1", "drone-0", "drone-1", "drone-2")
    groups = Group("rover", body, 0, 2), Group("drone", body, 2, 5)
    return replace(static(5), groups=groups, robot_names=names)


def test_entry_of_a_group_is_for_each_of_its_robots_unless_a_robot_has_its_own(robots):
    join = {"drone-1": "pid:7", "drone": "container:px4-{index}", "rover": "netns:lab-{name}"}
    joins = {join.robot: join.text for join in joins_of(Interface(join=join), robots, "").values()}
    assert joins == {
        "rover-0": "netns:lab-rover-0",
        "rover-1": "netns:lab-rover-1",
        "drone-0": "container:px4-0",
        "drone-1": "pid:7",
        "drone-2": "container:px4-2",
    }


def test_without_entries_no_robot_joins(robots):
    assert joins_of(Interface(), robots, "") == {}


@pytest.mark.parametrize("entry", ["drones", "drone-3", "rover-00"])
def test_entry_of_no_robot_is_refused(robots, entry):
    with refused_input("a.toml", f"{KEY}.{entry}", "expected one of "):
        joins_of(Interface(join={entry: "netns:lab"}), robots, "a.toml")


NO_FORMS = "lab", "docker:px4", "netns:", "netns:..", "netns:a/b", "pid:0", "pid:-1", "pid:px4", "pid:1.5"
NO_NAMES = "container:", "container:px4-{robot}", "container:px4-{index", "NETNS:lab", ""


@pytest.mark.parametrize("value", [*NO_FORMS, *NO_NAMES])
def test_value_of_no_known_form_is_refused(robots, value):
    with refused_input("a.toml", f"{KEY}.drone-2", "expected netns:NAME, pid:NUMBER or container:NAME"):
        joins_of(Interface(join={"drone-2": value}), robots, "a.toml")


def test_namespace_for_all_robots_of_a_group_is_refused(robots):
    with refused_input("a.toml", f"{KEY}.rover", "rover-0 and rover-1 share one; got netns:lab"):
        joins_of(Interface(join={"rover": "netns:lab"}), robots, "a.toml")
