"""How a world that waits for its runners is shown: what to type elsewhere, who came, and who is missing."""

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.markup import escape
from rich.status import Status

from swarmwire.comms.assignment import robots_text
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Static
from swarmwire.comms.wire.network import Network, is_local
from swarmwire.world.backends.registry import RunnerEvent


class Gathering(Observer):
    """Told of runners that come and go, and an observer, since the waiting is over when a run begins.

    Who came or went and who was refused is said by the run itself; here it is what is still missing.
    """

    def __init__(self, robots: tuple[str, ...], start_with: int | None, network: Network, console: Console) -> None:
        self._robots, self._network, self._console = robots, network, console
        self._start_with = start_with
        self._status: Status | None = None
        if console.is_terminal and not console.is_dumb_terminal and not console.quiet:
            self._status = console.status("")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._stop()

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        """Say what to type elsewhere."""
        self._print(f"run {run_id} listens at {', '.join(endpoints)}; agents join it by")
        self._print(f"  swarmwire join {endpoints[0]} --robots {len(self._robots)}{self._proof(endpoints[0])}")
        if self._status is not None:
            self._status.start()
        self._tell(self._robots)

    def changed(self, change: RunnerEvent, free: tuple[str, ...]) -> None:
        """Say who is missing."""
        if change.tick < 0:
            self._tell(free)

    def refused(self, runner: str, why: str) -> None:
        """The run says it."""

    def begin(self, static: Static) -> None:
        """Nobody is waited for any more."""
        self._stop()

    def _tell(self, free: tuple[str, ...]) -> None:
        played = len(self._robots) - len(free)
        text = f"{played} of {len(self._robots)} robots have agents"
        if self._start_with is not None:
            text += f", and the run begins with {self._start_with}"
        if free:
            text += f"; without: {robots_text(list(free))}"
        if self._status is not None:
            self._status.update(escape(text))
        else:
            self._print(text)

    def _proof(self, endpoint: str) -> str:
        if self._network.proves:
            return " --certs DIR"
        return "" if is_local(endpoint) else " --insecure"

    def _stop(self) -> None:
        if self._status is not None:
            self._status.stop()

    def _print(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)
