"""Whether an agent finds what it needs on its robot: on the body, from driver, radio and tracker."""

from collections.abc import Set as AbstractSet
from dataclasses import dataclass

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.errors import BadInput

OF_TRACKER = ("positioning", "compass")  # senses that poses of a tracker stand in for
OF_POSES = ("radio.range", "radio.bearing")  # what poses add to a real radio


@dataclass(frozen=True)
class Offer:
    """What there is on a robot."""

    body: Body
    driver: str  # its name
    driver_gives: AbstractSet[str]
    radio: str  # its kind
    radio_gives: AbstractSet[str]
    tracker: bool


def check_needs(agent: str, needs: tuple[str, ...], offer: Offer, where: str) -> None:
    """BadInput at `agent` in `where` for the first need that is not met: which, and what would give it."""
    for need in needs:
        fault = _of_radio(need, offer) if need.startswith("radio.") else _of_robot(need, offer)
        if fault:
            raise BadInput(where, "agent", f"{agent} needs {need!r}, which {fault}")


def tracked(needs: tuple[str, ...], offer: Offer) -> frozenset[str]:
    """The senses that the tracker gives: those of the body that the driver does not."""
    if not offer.tracker:
        return frozenset()
    return frozenset(need for need in needs if need in OF_TRACKER and need not in offer.driver_gives)


def _of_robot(need: str, offer: Offer) -> str | None:
    body = offer.body
    if need not in body.senses:
        return f"the body {body.name} lacks: it has {', '.join(body.senses) or 'no senses'}"
    if need in offer.driver_gives or need in tracked((need,), offer):
        return None
    gives = ", ".join(sorted(offer.driver_gives)) or "nothing"
    cure = ": expected tracker = true" if need in OF_TRACKER else ""
    return f"the driver {offer.driver} does not give (it gives {gives}){cure}"


def _of_radio(need: str, offer: Offer) -> str | None:
    if need in offer.radio_gives:
        return None
    if offer.radio == "none":
        return 'only a radio tells: expected radio.kind "zenoh" or "air"'
    if need in OF_POSES and offer.radio == "zenoh":
        return "a real radio does not tell: expected tracker = true"
    gives = ", ".join(sorted(offer.radio_gives)) or "nothing of a packet"
    return f"the radio {offer.radio} does not tell: it tells {gives}"
