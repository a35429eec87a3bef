"""Observers cannot break a run: one that raises is reported, counted and left out from then on."""

import traceback
from collections.abc import Callable
from typing import Any

from swarmwire.comms.errors import SwarmwireError
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import PacketCounts, Static, Truth
from swarmwire.deploy.refusals import refusal


class Guarded(Observer):
    """An observer whose errors end with it."""

    def __init__(self, observer: Observer, say: Callable[[str], None]) -> None:
        """`say` is told what failed."""
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
        except BaseException as error:  # noqa: BLE001 - the run goes on; rich exits where nobody reads, polars panics
            if not self.failed:
                self._say(f"observer {self.name} failed:{_why(error)}")
            self.failed = True
            return None


def _why(error: BaseException) -> str:
    """In a line, if it is no fault of the observer's; else with the traceback."""
    told = str(error) if isinstance(error, SwarmwireError) else refusal(error)
    return f" {told}; the run goes on without it" if told else f"\n{traceback.format_exc()}"
