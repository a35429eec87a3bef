"""A picture of a recording that rerun's viewer draws without a screen."""

import math
import subprocess
from collections import deque
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from swarmwire.comms.base.atomic import output_file
from swarmwire.comms.base.clock import NS_PER_S, WallClock
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.comms.base.extras import VIEW
from swarmwire.metrics.pictures.viewer.program import closed_environment, end, free_port, hidden_loopback, program

PATIENCE_NS = 60 * NS_PER_S  # for each of: the viewer is up, the picture stands still
_PAUSE_NS = NS_PER_S // 20
_SAME_IN_A_ROW = 4
_NO_GRAPHICS = ("No graphics adapter", "Failed to get render context")  # the viewer's messages without a Vulkan driver
_Found = TypeVar("_Found")


class NoGraphics(SwarmwireError):
    """This machine has nothing to draw with: the viewer needs a Vulkan driver, a GPU's or Mesa's on the processor."""


def render_png(rrd: Path, png: Path, at_s: float | None = None, size: tuple[int, int] = (1600, 900)) -> None:
    """Write the viewer's window, of this size in pixels, with the recording at this time (None: its end).

    The viewer is rerun's own program. It listens on this machine only, keeps its files in a temporary directory, and
    has ended when this returns. BadInput without the extra [view], the recording or the time; NoGraphics
    without a Vulkan driver; SwarmwireError if the viewer fails otherwise.
    """
    VIEW.need("picture")
    if png.suffix.lower() != ".png":
        raise BadInput(str(png), "", "expected a file name that ends in .png")
    if not rrd.is_file():
        raise BadInput(str(rrd), "", "there is no such recording")
    if not png.parent.is_dir():
        raise BadInput(str(png), "", "expected a path in a folder that exists")
    with _viewer(rrd, size) as viewer:
        client = viewer.wait(viewer.connected)
        state = viewer.wait(lambda: _opened(client))
        client.set_time("sim_time", duration=_time_s(state, at_s), play_state="paused")
        picture = viewer.wait(_still(client.take_screenshot))
    with output_file(png) as aside:
        aside.write_bytes(picture)


def _time_s(state: Any, at_s: float | None) -> float:
    """The time on the timeline to show: the middle of the tick that had begun by `at_s`.

    The start of a tick is rounded down to ns, and a cursor just before it would show the tick before.
    """
    end = {timeline.name: timeline.end for timeline in state.recordings[0].timelines}
    last_s = end["sim_time"] / NS_PER_S
    if at_s is None:
        return last_s
    per_tick_s = last_s / max(end["tick"], 1)
    if not 0.0 <= at_s < last_s + per_tick_s:
        raise BadInput("--at", "", f"expected a time that was recorded, 0 to {last_s:g} s; got {at_s:g}")
    return min((math.floor(at_s / per_tick_s + 1e-6) + 0.5) * per_tick_s, last_s)


def _opened(client: Any) -> Any | None:
    """The viewer's state once it shows the recording with its layout, else None."""
    state = client.get_state()
    return state if state.views and state.recordings and not state.loading else None


def _still(take: Callable[[], bytes]) -> Callable[[], bytes | None]:
    """A function that returns the picture once several in a row are equal, else None.

    After a jump in time the viewer loads missing data, and its plots slide into place.
    """
    row: deque[bytes] = deque(maxlen=_SAME_IN_A_ROW)

    def taken() -> bytes | None:
        row.append(take())
        return row[0] if row.count(row[0]) == _SAME_IN_A_ROW else None

    return taken


class _Viewer:
    """The viewer's process, with waits that end when it dies."""

    def __init__(self, process: subprocess.Popen[bytes], url: str, log: Path) -> None:
        self._process, self._url, self._log, self._clock = process, url, log, WallClock()

    def connected(self) -> Any | None:
        """A client, once the viewer listens."""
        from rerun.experimental import ViewerClient

        try:
            return ViewerClient.connect(self._url)
        except ConnectionError:
            return None

    def wait(self, ready: Callable[[], _Found | None]) -> _Found:
        """Poll `ready` until it returns a value, and return that."""
        until_ns = self._clock.now_ns() + PATIENCE_NS
        while self._clock.now_ns() < until_ns:
            try:
                found = ready()
            except (ConnectionError, RuntimeError):  # not up yet, or dead
                found = None
            if found is not None:
                return found
            if self._process.poll() is not None:
                raise _death(self._log.read_text(encoding="utf-8", errors="replace"))
            self._clock.sleep_until(self._clock.now_ns() + _PAUSE_NS)
        raise SwarmwireError(f"rerun's viewer had no picture after {PATIENCE_NS // NS_PER_S} s")


@contextmanager
def _viewer(rrd: Path, size: tuple[int, int]) -> Generator[_Viewer]:
    host = hidden_loopback()
    port = free_port(host)
    window = f"{size[0]}x{size[1]}"
    options = ["--headless", "--bind", host, "--port", str(port), "--window-size", window]
    with TemporaryDirectory(prefix="swarmwire-picture-") as home:
        log = Path(home, "log")
        with log.open("wb") as out:
            process = subprocess.Popen([program(), *options, rrd], env=_environment(home), stdout=out, stderr=out)
        try:
            yield _Viewer(process, f"rerun+http://{host}:{port}/proxy", log)
        finally:
            end(process)


def _environment(home: str) -> dict[str, str]:
    """A temporary home: the viewer neither reads nor writes the user's settings.

    Without a log there are no notices of it in the picture either.
    """
    closed = closed_environment()
    kept = {name: value for name, value in closed.items() if not name.startswith("XDG_") or name == "XDG_CONFIG_HOME"}
    return {**kept, "HOME": home, "XDG_RUNTIME_DIR": home, "RUST_LOG": "off"}


def _death(log: str) -> SwarmwireError:
    if any(words in log for words in _NO_GRAPHICS):
        return NoGraphics(
            "no graphics: rerun's viewer found no Vulkan driver; on Debian and Ubuntu `apt-get install libvulkan1 "
            "mesa-vulkan-drivers` brings one that needs no GPU"
        )
    return SwarmwireError(f"rerun's viewer ended unexpectedly:\n{log[-2000:]}")
