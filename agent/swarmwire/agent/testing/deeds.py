"""What robots did in a tick, as names and values that can be compared and shown."""

from collections.abc import Iterator
from itertools import chain

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.messages import DICT_TAG, decode_dict, message_classes
from swarmwire.comms.packets import BROADCAST, TAG_BYTES, UNTOLD, Sent
from swarmwire.comms.tick_io import Actions

Deed = tuple[int, str, str]  # robot, what it did, and the value, exactly
SPEEDS = ("linear_mps", "angular_radps", "lateral_mps")


def deeds(actions: Actions, body: Body) -> dict[int, dict[str, str]]:
    """What each robot did, by its row: the exact value of each deed, by its name."""
    found: dict[int, dict[str, str]] = {robot: {} for robot in actions.rows.tolist()}
    for robot, what, value in chain(_driven(actions), _shown(actions), _actuated(actions, body), _sent(actions.sent)):
        found[robot][what] = value
    return found


def _driven(actions: Actions) -> Iterator[Deed]:
    for name in SPEEDS:
        speeds: list[float] = getattr(actions, name).tolist()
        for robot, drives, speed in zip(actions.rows.tolist(), actions.drive.tolist(), speeds, strict=True):
            if drives:
                yield robot, f"drive: {name}", repr(speed)


def _shown(actions: Actions) -> Iterator[Deed]:
    notes, leds = actions.notes, actions.leds
    codes: list[int] = notes.code.tolist()
    for robot, code in zip(notes.rows.tolist(), codes, strict=True):
        yield robot, "note", repr(notes.names[code])
    for robot, value in zip(actions.values.rows.tolist(), actions.values.value.tolist(), strict=True):
        yield robot, "note: value", repr(value)
    for robot, which, rgb in zip(leds.rows.tolist(), leds.which.tolist(), leds.rgb.tolist(), strict=True):
        yield robot, f"led {which}", f"0x{rgb:06x}"


def _actuated(actions: Actions, body: Body) -> Iterator[Deed]:
    places = [f"{name}[{at}]" for name, sheet in body.actuators.items() for at in range(sheet.width)]
    rows, place, value = actions.own.rows.tolist(), actions.own.place.tolist(), actions.own.value.tolist()
    for robot, at, number in zip(rows, place, value, strict=True):
        yield robot, f"actuate: {places[at]}", repr(number)


def _sent(sent: Sent) -> Iterator[Deed]:
    packets: dict[int, int] = {}  # of each robot, up to now
    columns = sent.sender.tolist(), sent.to.tolist(), sent.outcome_ids.tolist()
    for at, (robot, to, outcome_id) in enumerate(zip(*columns, strict=True)):
        number = packets[robot] = packets.get(robot, 0) + 1
        yield robot, f"packet {number}: to", "all" if to == BROADCAST else f"robot {to}"
        if outcome_id != UNTOLD:
            yield robot, f"packet {number}: id", str(outcome_id)
        for name, value in _fields(sent.payloads.row(at)):
            yield robot, f"packet {number}: {name}", value


def _fields(payload: bytes) -> list[tuple[str, str]]:
    tag = int.from_bytes(payload[:TAG_BYTES], "little")
    if tag == DICT_TAG:
        return [("dict", repr(decode_dict(payload)))]
    for kind in message_classes():
        if (kind.tag, kind.size_bytes) == (tag, len(payload)):
            message = kind.decode(payload)
            values = [(f"{kind.__name__}.{name}", repr(getattr(message, name))) for name in kind.ranges]
            return values or [(kind.__name__, "sent")]
    return [("bytes", payload.hex(" "))]
