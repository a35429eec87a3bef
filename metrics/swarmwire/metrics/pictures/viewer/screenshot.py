"""Pictures of recordings, drawn by rerun's viewer without a screen."""

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
from swarmwire.metrics.pictures.viewer.program import closed_environment, end, free_port, hidden_loopback, viewer_path

TIMEOUT_NS = 60 * NS_PER_S  # limit of each wait for the viewer
_PAUSE_NS = NS_PER_S // 20
_EQUAL_PICTURES = 4  # equal pictures in a row that end a transition
_NO_GRAPHICS = ("No graphics adapter", "Failed to get render context")  # the viewer's messages without a Vulkan driver
_Value = TypeVar("_Value")


class NoGraphics(SwarmwireError):
    """The machine lacks a Vulkan driver, of a GPU or Mesa's on the processor."""


def render_png(rrd: Path, png: Path, at_s: float | None = None, size: tuple[int, int] = (1600, 900)) -> None:
    """Write a picture of the viewer's window, of this size in pixels, with the recording at a time (None: its end).

    The viewer is rerun's program. It listens on this machine only, keeps its files in a temporary directory, and has
    ended when the function returns. BadInput without the extra [view], the recording or the time; NoGraphics without a
    Vulkan driver; SwarmwireError if the viewer fails otherwise.
    """
    VIEW.need("picture")
    if png.suffix.lower() != ".png":
        raise BadInput(str(png), "", "expected a file name that ends in .png")
    if not rrd.is_file():
        raise BadInput(str(rrd), "", "expected a recording, which does not exist")
    if not png.parent.is_dir():
        raise BadInput(str(png), "", "expected a path in a folder that exists")
    with _viewer(rrd, size) as viewer:
        client = viewer.wait(viewer.connected)
        state = viewer.wait(lambda: _opened(client))
        client.set_time("sim_time", duration=_time_s(state, at_s), play_state="paused")
        picture = viewer.wait(_still(client.take_screenshot))
    with output_file(png) as part:
        part.write_bytes(picture)


def _time_s(state: Any, at_s: float | None) -> float:
    """Return the time on the timeline to show: the middle of the latest tick that has begun at `at_s`.

    The start of a tick is rounded down to ns, and a cursor just before it would show the previous tick.
    """
    end = {timeline.name: timeline.end for timeline in state.recordings[0].timelines}
    last_s = end["sim_time"] / NS_PER_S
    if at_s is None:
        return last_s
    per_tick_s = last_s / max(end["tick"], 1)
    if not 0.0 <= at_s < last_s + per_tick_s:
        raise BadInput("--at", "", f"expected a recorded time, 0 to {last_s:g} s; got {at_s:g}")
    return min((math.floor(at_s / per_tick_s + 1e-6) + 0.5) * per_tick_s, last_s)


def _opened(client: Any) -> Any | None:
    """Return the viewer's state if it shows the recording with its layout, else None."""
    state = client.get_state()
    return state if state.views and state.recordings and not state.loading else None


def _still(take: Callable[[], bytes]) -> Callable[[], bytes | None]:
    """Return a function that returns the picture if the latest pictures are equal, else None.

    After a jump in time the viewer loads missing data, and its plots move.
    """
    latest: deque[bytes] = deque(maxlen=_EQUAL_PICTURES)

    def picture() -> bytes | None:
        latest.append(take())
        return latest[0] if latest.count(latest[0]) == _EQUAL_PICTURES else None

    return picture


class _Viewer:
    """The viewer's process, with waits that end when it dies."""

    def __init__(self, process: subprocess.Popen[bytes], url: str, log: Path) -> None:
        self._process, self._url, self._log, self._clock = process, url, log, WallClock()

    def connected(self) -> Any | None:
        """Return a client if the viewer listens, else None."""
        from rerun.experimental import ViewerClient

        try:
            return ViewerClient.connect(self._url)
        except ConnectionError:
            return None

    def wait(self, ready: Callable[[], _Value | None]) -> _Value:
        """Poll `ready` until it returns a value, and return the value."""
        deadline_ns = self._clock.now_ns() + TIMEOUT_NS
        while self._clock.now_ns() < deadline_ns:
            try:
                value = ready()
            except (ConnectionError, RuntimeError):  # the viewer is starting, or dead
                value = None
            if value is not None:
                return value
            if self._process.poll() is not None:
                raise _death(self._log.read_text(encoding="utf-8", errors="replace"))
            self._clock.sleep_until(self._clock.now_ns() + _PAUSE_NS)
        raise SwarmwireError(f"rerun's viewer had no picture after {TIMEOUT_NS // NS_PER_S} s")


@contextmanager
def _viewer(rrd: Path, size: tuple[int, int]) -> Generator[_Viewer]:
    host = hidden_loopback()
    port = free_port(host)
    window = f"{size[0]}x{size[1]}"
    options = ["--headless", "--bind", host, "--port", str(port), "--window-size", window]
    with TemporaryDirectory(prefix="swarmwire-picture-") as home:
        log = Path(home, "log")
        with log.open("wb") as out:
            process = subprocess.Popen([viewer_path(), *options, rrd], env=_environment(home), stdout=out, stderr=out)
        try:
            yield _Viewer(process, f"rerun+http://{host}:{port}/proxy", log)
        finally:
            end(process)


def _environment(home: str) -> dict[str, str]:
    """Return an environment with a temporary home, so that the viewer does not access the user's settings.

    Without a log, the picture contains no notices of the log.
    """
    closed = closed_environment()
    names = [name for name in closed if not name.startswith("XDG_") or name == "XDG_CONFIG_HOME"]
    return {**{name: closed[name] for name in names}, "HOME": home, "XDG_RUNTIME_DIR": home, "RUST_LOG": "off"}


def _death(log: str) -> SwarmwireError:
    if any(message in log for message in _NO_GRAPHICS):
        return NoGraphics(
            "no graphics: rerun's viewer found no Vulkan driver; on Debian and Ubuntu `apt-get install libvulkan1 "
            "mesa-vulkan-drivers` brings one that needs no GPU"
        )
    return SwarmwireError(f"rerun's viewer ended unexpectedly:\n{log[-2000:]}")
