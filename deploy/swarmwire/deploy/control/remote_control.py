"""Control over a run that another process executes, here or elsewhere; behind `swarmwire ctl` and the page."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from typing import Any

import zenoh

from swarmwire.comms.errors import BadFrame, SwarmwireError
from swarmwire.comms.wire.control_frames import ControlRequest, decode_reply, encode_request
from swarmwire.comms.wire.keys import ObserverKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.sessions import closed_after, open_observer
from swarmwire.deploy.live.following import RunGone

ANY_PUBLISHED = ObserverKeys("*").published
ANSWER_S = 10.0  # a run answers in milliseconds, unless its machine is very busy


class Refused(SwarmwireError):
    """What the run does not do, in its own line: an unknown robot, an event that is over, a speed beyond bounds."""


class RemoteControl:
    """What may be asked of a run. Each call returns once the run has taken it; `status` tells when it has done it.

    Each raises Refused with the run's line, and RunGone if nobody answers.
    """

    def __init__(self, session: zenoh.Session, run: str) -> None:
        """Of the run of this id, on a session with its observers' endpoint."""
        self._session, self._keys = session, ObserverKeys(run)

    def status(self) -> dict[str, Any]:
        """How the run is doing: tick, state, robots alive, runners, metrics, the radio's numbers, events."""
        return self._get(self._keys.status)

    def pause(self) -> dict[str, Any]:
        """Let no tick begin from now on."""
        return self._ask("pause")

    def resume(self) -> dict[str, Any]:
        """Go on."""
        return self._ask("resume")

    def step(self, n: int = 1) -> dict[str, Any]:
        """Let exactly `n` ticks go, then pause."""
        return self._ask("step", n)

    def speed(self, factor: float | None) -> dict[str, Any]:
        """So many simulated seconds per second of wall time; None: as fast as possible."""
        return self._ask("speed", factor)

    def stop(self) -> dict[str, Any]:
        """End the run after the tick that is under way."""
        return self._ask("stop")

    def event(self, table: Mapping[str, Any]) -> int:
        """Have an event happen at the start of the next tick; its number. The table is a scenario's, without at_s."""
        return int(self._ask("event", dict(table))["event"])

    def end(self, number: int) -> dict[str, Any]:
        """Undo an event that lasts, at the start of the next tick."""
        return self._ask("end", number)

    def _ask(self, do: str, value: Any = None) -> dict[str, Any]:
        return self._get(self._keys.control, encode_request(ControlRequest(do, value)))

    def _get(self, key: str, payload: bytes | None = None) -> dict[str, Any]:
        try:
            for reply in self._session.get(key, payload=payload, timeout=ANSWER_S):
                if reply.ok is not None:
                    return decode_reply(reply.ok.payload.to_bytes())
                line = reply.err.payload.to_string() if reply.err else ""
                if line != "Timeout":
                    raise Refused(line)
        except zenoh.ZError as error:
            raise RunGone(f"the run cannot be asked any more: {str(error).split(' at ')[0]}") from error
        except BadFrame as error:
            raise Refused(f"the run answers in another way than this swarmwire expects: {error}") from error
        raise RunGone("nobody answers: the run has ended or hangs, or who asks may not")


@contextmanager
def controlling(endpoint: str, run: str, network: Network | None = None) -> Generator[RemoteControl]:
    """Control over the run of this id, by its observers' endpoint, until the end of the block; RunGone if it is gone.

    `network` brings the certificates that an endpoint beyond this machine asks for.
    """
    with _observing(endpoint, network) as session:
        yield RemoteControl(session, run)


def only_run_at(endpoint: str, network: Network | None = None) -> str:
    """The id of the run that is published at an endpoint; RunGone if there is none, or several."""
    with _observing(endpoint, network) as session:
        found = session.liveliness().get(ANY_PUBLISHED, timeout=ANSWER_S)
        runs = sorted({str(reply.ok.key_expr).split("/")[1] for reply in found if reply.ok is not None})
    if len(runs) != 1:
        raise RunGone(f"expected a run at {endpoint}, found {', '.join(runs) or 'none'}; RUN names one")
    return runs[0]


@contextmanager
def _observing(endpoint: str, network: Network | None) -> Generator[zenoh.Session]:
    try:
        session = open_observer(endpoint, network)
    except zenoh.ZError as error:
        refused = ", or one certificate or the other is not accepted" if network and network.proves else ""
        reason = str(error).split(" at ")[0]
        raise RunGone(f"the run at {endpoint} cannot be reached{refused}: {reason}") from error
    with closed_after(session):
        yield session
