import pytest

from swarmwire.agent.on_robot.needs import OF_POSES, Offer, check_needs, tracked
from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.errors import BadInput

BODY = load_body("epuck2")  # it has a compass, and no positioning
FOOTBOT = load_body("footbot")


def _offer(driver: tuple[str, ...] = ("proximity",), radio: str = "none", tracker: bool = False, body=BODY) -> Offer:
    tells = frozenset(OF_POSES) if radio == "zenoh" and tracker else frozenset[str]()
    return Offer(body, "epuck2", frozenset(driver), radio, tells, tracker)


MET = {
    "of the driver": (("proximity",), _offer()),
    "nothing": ((), _offer(())),
    "the compass from the tracker": (("compass",), _offer(tracker=True)),
    "range and bearing from the tracker": (OF_POSES, _offer(radio="zenoh", tracker=True)),
}


@pytest.mark.parametrize("case", MET)
def test_what_is_there_is_taken(case):
    check_needs("Mine", *MET[case], "robot.toml")


UNMET = {
    "ground": (_offer(), "the driver epuck2 does not give (it gives proximity)"),
    "compass": (_offer(), "does not give (it gives proximity): expected tracker = true"),
    "camera": (_offer(), "the body epuck2 lacks: it has proximity"),
    "positioning": (_offer(tracker=True), "the body epuck2 lacks"),
    "radio.range": (_offer(), 'only a radio tells: expected radio.kind "zenoh" or "air"'),
    "radio.bearing": (_offer(radio="zenoh"), "a real radio does not tell: expected tracker = true"),
    "radio.outcomes": (_offer(radio="zenoh", tracker=True), "the radio zenoh does not tell: it tells radio.bearing"),
    "radio.rssi": (_offer(radio="air"), "the radio air does not tell: it tells nothing"),
}


@pytest.mark.parametrize("need", UNMET)
def test_what_is_not_there_is_refused_with_what_would_give_it(need):
    offer, told = UNMET[need]
    with pytest.raises(BadInput) as refused:
        check_needs("Mine", ("proximity", need), offer, "robot.toml")
    assert str(refused.value).startswith(f"robot.toml: agent: Mine needs {need!r}, which ")
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_tracker_stands_in_only_for_what_the_driver_does_not_give():
    needs = ("compass", "positioning", "proximity")
    assert tracked(needs, _offer(("compass",), tracker=True)) == {"positioning"}
    assert tracked(needs, _offer(("compass",))) == frozenset()
