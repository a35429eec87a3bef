"""What a tick carries across the wire: senses and heard packets to a runner, actions back; checked on arrival."""

import numpy as np

from swarmwire.comms.arrays import AnyArray, IntArray
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.packets import BROADCAST, Heard, Payloads, Sent
from swarmwire.comms.senses import Actions, GroupSenses, Senses
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import Frame


def encode_tick(tick: int, senses: Senses, heard: Heard) -> bytes:
    """A `tick` frame: what a runner's robots sense and heard."""
    arrays: dict[str, AnyArray] = {}
    for name, group in senses.items():
        arrays[f"sense/{name}/rows"] = group.rows
        for sense, column in group.fields.items():
            arrays[f"sense/{name}/{sense}"] = column
    if len(heard):
        # A row per column, so that each is contiguous again on the other side.
        numbers = (heard.receiver, heard.sender, heard.sequence, heard.heard_at_ns, heard.payload)
        arrays["heard/numbers"] = np.array(numbers)
        arrays["heard/given"] = np.array(list(heard.given.values())).reshape(len(heard.given), len(heard))
        arrays["heard/data"] = heard.payloads.data
        arrays["heard/offset"] = heard.payloads.offset
    return frames.encode("tick", tick, arrays)


def decode_tick(frame: Frame, gives: tuple[str, ...]) -> tuple[Senses, Heard]:
    """Senses and heard packets of a `tick` frame; a runner trusts its world."""
    groups: dict[str, dict[str, AnyArray]] = {}
    for key, array in frame.arrays.items():
        if key.startswith("sense/"):
            _, name, sense = key.split("/", 2)
            groups.setdefault(name, {})[sense] = array
    senses = {name: GroupSenses(fields.pop("rows"), fields) for name, fields in groups.items()}
    arrays = frame.arrays
    if "heard/numbers" not in arrays:
        return senses, Heard.none(gives)
    receiver, sender, sequence, heard_at_ns, payload = arrays["heard/numbers"]
    given = dict(zip(gives, arrays["heard/given"], strict=True))
    payloads = Payloads(arrays["heard/data"], arrays["heard/offset"])
    return senses, Heard(receiver, sender, sequence, heard_at_ns, given, payload, payloads)


def encode_actions(tick: int, actions: Actions, dropped: int = 0) -> bytes:
    """An `actions` frame: what a runner's robots do and send, and how many frames to it were none that it could use."""
    arrays: dict[str, AnyArray] = {
        "rows": actions.rows,
        "drive": actions.drive,
        "linear_mps": actions.linear_mps,
        "angular_radps": actions.angular_radps,
    }
    if len(actions.sent):
        arrays["sent/sender"] = actions.sent.sender
        arrays["sent/to"] = actions.sent.to
        arrays["sent/data"] = actions.sent.payloads.data
        arrays["sent/offset"] = actions.sent.payloads.offset
    return frames.encode("actions", tick, arrays, {"dropped": dropped} if dropped else None)


def decode_actions(frame: Frame, rows: IntArray) -> Actions:
    """The actions of the robots `rows`; BadFrame if the frame is not for exactly these or contradicts itself."""
    n = len(rows)
    if (_column(frame, "rows", "<i8", n) != rows).any():
        raise BadFrame("malformed", "rows: expected the runner's own robots")
    drive = _column(frame, "drive", "|b1", n)
    linear = _column(frame, "linear_mps", "<f8", n)
    angular = _column(frame, "angular_radps", "<f8", n)
    return Actions(rows, drive, linear, angular, _sent(frame, rows) if "sent/sender" in frame.arrays else Sent.none())


def _sent(frame: Frame, rows: IntArray) -> Sent:
    sender = _column(frame, "sent/sender", "<i8")
    to = _column(frame, "sent/to", "<i8", len(sender))
    offset = _column(frame, "sent/offset", "<i8", len(sender) + 1)
    data = _column(frame, "sent/data", "|u1")
    if offset[0] != 0 or offset[-1] != len(data) or (offset[1:] < offset[:-1]).any():
        raise BadFrame("malformed", "sent/offset: expected rising offsets into sent/data")
    known = np.sort(rows)
    if (known[np.searchsorted(known[:-1], sender)] != sender).any() or (to < BROADCAST).any():
        raise BadFrame("malformed", "sent: expected packets of the runner's own robots")
    return Sent(sender, to, Payloads(data, offset))


def _column(frame: Frame, name: str, code: str, length: int | None = None) -> AnyArray:
    array = frame.arrays.get(name)
    fits = array is not None and array.ndim == 1 and (length is None or len(array) == length)
    if array is None or not fits or array.dtype != frames.DTYPES[code]:
        raise BadFrame("malformed", f"{name}: expected a column of {code} of the right length")
    return array
