"""The run's side of control: it answers in zenoh's own thread, since the loop may be long in a tick, or paused."""

# zenoh's stubs leave out the return types of reply and reply_err.
# pyright: reportUnknownMemberType=false

from collections.abc import Callable, Mapping
from typing import Any

import zenoh

from swarmwire.comms.errors import BadInput, SwarmwireError
from swarmwire.comms.wire.control_frames import ControlRequest, decode_request, encode_reply
from swarmwire.comms.wire.keys import ObserverKeys
from swarmwire.deploy.control.status import Status
from swarmwire.deploy.controls import Controls


class ControlServer:
    """Answers who asks how a run is doing, and does what those ask who may control it.

    What is refused is answered with one line, and changes nothing. `give` takes an event's table and returns its
    number, `end` undoes an event; both are `LiveEvents`'.
    """

    def __init__(
        self,
        status: Status,
        controls: Controls,
        give: Callable[[Mapping[str, Any]], int],
        end: Callable[[int], None],
        note: Callable[[str], None],
    ) -> None:
        """`note` keeps in the run's log what was done."""
        self._status, self._controls, self._give, self._end, self._note = status, controls, give, end, note

    def declare(self, session: zenoh.Session, keys: ObserverKeys) -> object:
        """Answer on this session for as long as what is returned is kept."""

        def status(query: zenoh.Query) -> None:
            _answer(query, keys.status, lambda _: self._status.now())

        def control(query: zenoh.Query) -> None:
            _answer(query, keys.control, self._do)

        return (
            session.declare_queryable(keys.status, zenoh.handlers.Callback(status, indirect=False)),
            session.declare_queryable(keys.control, zenoh.handlers.Callback(control, indirect=False)),
        )

    def _do(self, payload: bytes) -> dict[str, Any]:
        request = decode_request(payload)
        done, number = self.do(request)
        self._note(f"control: {done}")
        return {"done": done, "tick": self._status.tick, "event": number}

    def do(self, request: ControlRequest) -> tuple[str, int | None]:
        """Do it: what was done in words, and the number of the event, if it is one; BadInput if it is refused."""
        controls, value = self._controls, request.value
        match request.do:
            case "pause":
                controls.pause()
                return "paused", None
            case "resume":
                controls.resume()
                return "going on", None
            case "step":
                controls.step_by(value)
                return f"{value} {'tick' if value == 1 else 'ticks'}, then paused", None
            case "speed":
                controls.set_speed(value)
                return "as fast as possible" if value is None else f"{value:g} times real time", None
            case "stop":
                controls.quit()
                return "ending after this tick", None
            case "event":
                number = self._give(value)
                return f"event {number}: {value['do']}", number
            case "end":
                self._end(value)
                return f"event {value} ends", value
            case other:
                raise BadInput("", "do", f"nothing is known about {other!r}")


def _answer(query: zenoh.Query, key: str, work: Callable[[bytes], Mapping[str, Any]]) -> None:
    """Reply with what `work` makes of the request's bytes, or with the line that says why not."""
    try:
        reply = encode_reply(work(query.payload.to_bytes() if query.payload else b""))
    except SwarmwireError as error:
        query.reply_err(str(error))
    except Exception as error:  # noqa: BLE001 - an error here must not end zenoh's thread, nor the run
        query.reply_err(f"the run could not do it: {type(error).__name__}: {error}")
    else:
        query.reply(key, reply)
