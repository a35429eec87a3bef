"""Observers that every run has: a guard around each other observer, and a warning about packets that are too large."""

import traceback
from collections.abc import Callable
from typing import Any

import numpy as np

from swarmwire.comms.errors import SwarmwireError
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.packets import Fate
from swarmwire.comms.truth import PacketCounts, Static, Truth
from swarmwire.deploy.host import refusal


class Guarded(Observer):
    """An observer that, once it raises, is reported, counted and left out; the run continues."""

    def __init__(self, observer: Observer, say: Callable[[str], None]) -> None:
        self._observer, self._say = observer, say
        self.failed, self.before_agents = False, observer.before_agents

    @property
    def name(self) -> str:
        """The observer's class."""
        return type(self._observer).__name__

    def begin(self, static: Static) -> None:
        """The run is about to start."""
        self._try(lambda: self._observer.begin(static))

    def see(self, truth: Truth) -> None:
        """One tick is over."""
        if not self.failed:
            self._try(lambda: self._observer.see(truth))

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """The run is over; also an observer that failed may close its files."""
        return self._try(lambda: self._observer.end(last)) or {}

    def _try(self, call: Callable[[], Any]) -> Any:
        try:
            return call()
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - the run continues; rich exits without a reader, polars panics
            if not self.failed:
                self._say(f"observer {self.name} failed:{_why(error)}")
            self.failed = True
            return None


def _why(error: BaseException) -> str:
    """In a line, if the machine or the input is at fault; else with the traceback."""
    text = str(error) if isinstance(error, SwarmwireError) else refusal(error)
    return f" {text}; the run continues without it" if text else f"\n{traceback.format_exc()}"


class TooLarge(Observer):
    """Warns once of a packet above the medium's largest payload, which is never sent: an agent's mistake."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._told = False

    def begin(self, static: Static) -> None:
        """The run is about to start."""
        self._names = static.robot_names

    def see(self, truth: Truth) -> None:
        """Warn of the first one."""
        if self._told or truth.finished is None or truth.tally is None:
            return
        if truth.tally.fates[:, Fate.TOO_LARGE].any():
            finished, self._told = truth.finished, True
            first = np.flatnonzero(finished.fate == Fate.TOO_LARGE)[0]
            who, size_bytes = self._names[finished.sender[first]], finished.size_bytes[first]
            self._say(f"{who} sent {size_bytes} bytes, more than radio.max_payload_bytes: never on air (too_large)")
