"""What is said of a body that is another robot than its gateway emulates; what cannot be one is refused."""

import pytest

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.world.gateways.epuck2 import Epuck2Gateway
from swarmwire.world.gateways.gateway import Gateway
from swarmwire.world.gateways.ros2 import Ros2Gateway


def said(kind: type[Gateway], body: str) -> str:
    return "; ".join(kind(("a-0",), load_body(body), "", kind.options(), WallClock()).differences())


@pytest.mark.parametrize(("kind", "body"), [(Epuck2Gateway, "epuck2"), (Ros2Gateway, "turtlebot3-burger")])
def test_of_the_robot_itself_nothing_is_said(kind, body) -> None:
    assert said(kind, body) == ""


def test_an_epuck_as_an_epuck2_has_other_eyes_and_less_senses() -> None:
    text = said(Epuck2Gateway, "epuck")
    assert "its proximity looks to 17, 50, 90, ... deg, not -10, -40, -90, ... deg" in text
    assert "it goes up to 0.1287 m/s, not 0.1382" in text
    assert "it has no scan, imu" in text
    assert "nobody is told its camera" in text


def test_an_epuck2_as_a_base_of_ros_2_keeps_its_proximity_to_itself() -> None:
    assert said(Ros2Gateway, "epuck2") == "nobody is told its proximity, ground, bumper; nobody switches its LEDs"


@pytest.mark.parametrize("body", ["turtlebot3-burger", "footbot", "point"])
def test_what_cannot_be_an_epuck2_is_refused(body) -> None:
    with pytest.raises(BadInput, match=f"body {body}: .*as an e-puck2 has"):
        said(Epuck2Gateway, body)
