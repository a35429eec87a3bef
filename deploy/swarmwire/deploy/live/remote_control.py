"""Control of a run in another process, for `swarmwire ctl` and the page."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from typing import Any

import zenoh

from swarmwire.comms.base.errors import BadFrame, SwarmwireError
from swarmwire.comms.wire.control_frames import ControlRequest, decode_reply, encode_request
from swarmwire.comms.wire.keys import ObserverKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.sessions import closed_after, open_observer
from swarmwire.deploy.live.subscription import RunGone

ANY_PUBLISHED = ObserverKeys("*").published
ANSWER_TIMEOUT_S = 10.0  # a run answers in milliseconds, unless its machine is very busy


class Refused(SwarmwireError):
    """The run refuses a command: an unknown robot, an event that is over, a speed out of bounds."""


class RemoteControl:
    """Commands to a live run. Each call returns once the run has accepted it; `status` shows its effect.

    Calls raise Refused with the run's reason, and RunGone if no run answers.
    """

    def __init__(self, session: zenoh.Session, run: str) -> None:
        """Control the run of this id, on a session with its observers' endpoint."""
        self._session, self._keys = session, ObserverKeys(run)

    def status(self) -> dict[str, Any]:
        """Return the status: tick, state, robots alive, runners, metrics, the radio's numbers, events."""
        return self._get(self._keys.status)

    def pause(self) -> dict[str, Any]:
        """Pause the run at the end of the current tick."""
        return self._command("pause")

    def resume(self) -> dict[str, Any]:
        """Resume."""
        return self._command("resume")

    def step(self, n: int = 1) -> dict[str, Any]:
        """Run exactly `n` ticks, then pause."""
        return self._command("step", n)

    def speed(self, factor: float | None) -> dict[str, Any]:
        """Set the speed in simulated seconds per second of wall time; None: as fast as possible."""
        return self._command("speed", factor)

    def stop(self) -> dict[str, Any]:
        """End the run after the current tick."""
        return self._command("stop")

    def event(self, table: Mapping[str, Any]) -> int:
        """Submit an event (a scenario's table without at_s) for the start of the next tick; return its number."""
        return int(self._command("event", dict(table))["event"])

    def end(self, number: int) -> dict[str, Any]:
        """End a lasting event at the start of the next tick."""
        return self._command("end", number)

    def _command(self, do: str, value: Any = None) -> dict[str, Any]:
        return self._get(self._keys.control, encode_request(ControlRequest(do, value)))

    def _get(self, key: str, payload: bytes | None = None) -> dict[str, Any]:
        try:
            for reply in self._session.get(key, payload=payload, timeout=ANSWER_TIMEOUT_S):
                if reply.ok is not None:
                    return decode_reply(reply.ok.payload.to_bytes())
                line = reply.err.payload.to_string() if reply.err else ""
                if line != "Timeout":
                    raise Refused(line)
        except zenoh.ZError as error:
            raise RunGone(f"the run cannot be reached any more: {str(error).split(' at ')[0]}") from error
        except BadFrame as error:
            raise Refused(f"the run's answer is not that of this version of swarmwire: {error}") from error
        raise RunGone("no answer: the run has ended or hangs, or this client lacks the right")


@contextmanager
def controlling(endpoint: str, run: str, network: Network | None = None) -> Generator[RemoteControl]:
    """Yield control of the run of this id, by its observers' endpoint; RunGone if it is gone.

    `network` has the certificates for an endpoint on another machine.
    """
    with _observing(endpoint, network) as session:
        yield RemoteControl(session, run)


def only_run_at(endpoint: str, network: Network | None = None) -> str:
    """Return the id of the run that is published at an endpoint; RunGone if there is none, or several."""
    with _observing(endpoint, network) as session:
        replies = session.liveliness().get(ANY_PUBLISHED, timeout=ANSWER_TIMEOUT_S)
        runs = sorted({str(reply.ok.key_expr).split("/")[1] for reply in replies if reply.ok is not None})
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
