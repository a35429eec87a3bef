"""Control requests to a run at the observers' endpoint, and the replies: small msgpack maps, checked on arrival."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any, cast

import msgpack

from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.wire.frames import typed, unpacked

CONTROL_VERSION = 1
MAX_BYTES = 64 * 1024  # size of a request
MAX_REPLY_BYTES = 16 * 1024 * 1024
MAX_STEPS = 1_000_000

# Name of each request, and the key of its value; None: no value.
REQUESTS: dict[str, str | None] = {
    "pause": None,
    "resume": None,
    "step": "n",
    "speed": "factor",
    "stop": None,
    "event": "event",
    "end": "event",
}


@dataclass(frozen=True, slots=True)
class ControlRequest:
    """A control request."""

    do: str
    value: Any = None  # number of ticks, a factor (None: no limit), an event's table, or an event's number


def encode_request(request: ControlRequest) -> bytes:
    """Encode a request; BadInput if msgpack cannot hold its value."""
    key = REQUESTS[request.do]
    try:
        return msgpack.packb({"v": CONTROL_VERSION, "do": request.do} | ({key: request.value} if key else {}))
    except (OverflowError, TypeError, ValueError) as error:
        expected = f"expected texts, numbers of at most 64 bits, lists and tables alone: {error}"
        raise BadInput("", key or "", expected) from None


def decode_request(data: bytes) -> ControlRequest:
    """Decode a request; BadInput states the expectation in one line."""
    try:
        values = typed(dict[str, Any], unpacked(data, MAX_BYTES), "request")
    except BadFrame as fault:
        raise BadInput("", "", f"expected a request: {fault}") from None
    if type(values.get("v")) is not int or values["v"] != CONTROL_VERSION:
        raise BadInput("", "v", f"expected version {CONTROL_VERSION} of control, got {_shown(values.get('v'))}")
    do = values.get("do")
    if not isinstance(do, str) or do not in REQUESTS:
        raise BadInput("", "do", f"expected {did_you_mean(REQUESTS, do)}; got {_shown(do)}")
    key = REQUESTS[do]
    for name in values:
        if name not in ("v", "do", key):
            raise BadInput("", name, f"unknown key of {do!r}; expected {key or 'none'}")
    value = _value(do, values.get(key, 1 if do == "step" else None)) if key else None
    return ControlRequest(do, value)


def encode_reply(reply: Mapping[str, Any]) -> bytes:
    """Encode a reply: `done`, `tick` and `event` to a control request, the run's status to a status query."""
    return msgpack.packb({"v": CONTROL_VERSION, **reply})


def decode_reply(data: bytes) -> dict[str, Any]:
    """Decode a reply; BadFrame if the bytes hold none."""
    reply = typed(dict[str, Any], unpacked(data, MAX_REPLY_BYTES), "reply")
    if type(reply.get("v")) is not int or reply["v"] != CONTROL_VERSION:
        raise BadFrame("malformed", f"version {reply.get('v')!r} of control, expected {CONTROL_VERSION}")
    return reply


def _value(do: str, value: object) -> Any:
    if do == "step":
        if type(value) is int and 1 <= value <= MAX_STEPS:
            return value
        raise BadInput("", "n", f"expected a whole number of ticks from 1 to {MAX_STEPS}, got {_shown(value)}")
    if do == "speed":
        if value is None or (type(value) in (int, float) and isfinite(cast("float", value))):
            return None if value is None else float(cast("float", value))
        raise BadInput("", "factor", f"expected simulated seconds per second, or none, got {_shown(value)}")
    if do == "end":
        if type(value) is int:
            return value
        raise BadInput("", "event", f"expected the number of an event, got {_shown(value)}")
    if isinstance(value, dict):
        table = cast("dict[object, object]", value)
        if all(type(name) is str for name in table):
            return table
    expected = 'expected a table as in a scenario, such as { do = "kill", robots = { count = 3 } }'
    raise BadInput("", "event", f"{expected}; got {_shown(cast('object', value))}")


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
