"""Rerun's viewer for a browser, with its recording, from a web server on loopback.

Rerun's own server would load fonts from other servers, and its data would be open to websites by DNS rebinding. So
rerun's program only provides the viewer's code, and has ended before the run is shown.
"""

import asyncio
import threading
import urllib.request
from collections import deque
from collections.abc import AsyncGenerator, Generator, Mapping
from contextlib import closing, contextmanager
from itertools import islice
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp

from swarmwire.comms.base.clock import Clock
from swarmwire.deploy.live.page.serving import HOSTS, RequestGuard, serving
from swarmwire.deploy.live.viewer import AbandonmentDetector, Viewer, rerun

PAGE = Path(__file__).with_name("viewer")
CODE = {"re_viewer.js": "text/javascript", "re_viewer_bg.wasm": "application/wasm"}  # media types by file
RECORDING_TYPE = "application/octet-stream"
LIVE_BYTES = 2_000_000_000  # recording of a live run; beyond it the oldest ticks are dropped
READ_TIMEOUT_S = 30.0
# The page of a run, at another port, shows the viewer in a frame. The code is web assembly.
POLICY = f"script-src 'self' 'wasm-unsafe-eval'; frame-ancestors {' '.join(f'http://{host}:*' for host in HOSTS)}"


class GrowingRecording:
    """The parts of a recording: written by the thread that draws, read from the first part by any number of browsers.

    Above its limit the oldest parts are dropped, except the first, which contains the constants.
    """

    def __init__(self, limit_bytes: int) -> None:
        self._limit_bytes, self._bytes = limit_bytes, 0
        self._first: bytes | None = None
        self._parts: deque[bytes] = deque()  # later parts
        self._dropped = 0
        self._closed = False
        self._readers: dict[asyncio.Event, asyncio.AbstractEventLoop] = {}
        self._lock = threading.Lock()

    @property
    def readers(self) -> int:
        """Number of reading browsers, including those that wait for the next part."""
        return len(self._readers)

    def write(self, part: bytes) -> None:
        """Append a part."""
        with self._lock:
            if self._first is None:
                self._first = part
            else:
                self._parts.append(part)
                self._bytes += len(part)
            while self._bytes > self._limit_bytes:
                self._bytes -= len(self._parts.popleft())
                self._dropped += 1
            self._wake()

    def close(self) -> None:
        """End the recording; readers end after its last part."""
        with self._lock:
            self._closed = True
            self._wake()

    async def read(self) -> AsyncGenerator[bytes]:
        """Yield all parts as they arrive, until the recording is closed; dropped parts are skipped."""
        more = asyncio.Event()
        with self._lock:
            self._readers[more] = asyncio.get_running_loop()
        try:
            written, closed = 0, False
            while not closed:
                more.clear()
                with self._lock:
                    parts, written = self._after(written)
                    closed = self._closed
                for part in parts:
                    yield part
                if not closed:
                    await more.wait()
        finally:
            with self._lock:
                del self._readers[more]

    def _after(self, count: int) -> tuple[list[bytes], int]:
        """Return the parts after the first `count` written parts, and the number of written parts."""
        if self._first is None:
            return [], 0
        first = [] if count else [self._first]
        later = islice(self._parts, max(count - 1 - self._dropped, 0), None)
        return [*first, *later], 1 + self._dropped + len(self._parts)

    def _wake(self) -> None:
        for more, loop in self._readers.items():
            loop.call_soon_threadsafe(more.set)


@contextmanager
def web_viewer(clock: Clock, recording: Path | None, port: int | None = None) -> Generator[Viewer]:
    """Yield a viewer for browsers, with this recording or for a live run; BadInput if the port is in use."""
    code, live = viewer_code(clock), GrowingRecording(LIVE_BYTES)

    def app(token: str, port: int) -> ASGIApp:
        return viewer_app(code, recording or live, token, port)

    with serving(app, clock, port) as address, closing(live):
        yield Viewer(live.write, address, lambda: True, AbandonmentDetector(clock, lambda: live.readers))


def viewer_code(clock: Clock) -> dict[str, bytes]:
    """Return the files of the viewer's code by name, from rerun's program as a server."""
    with rerun(clock, [], web=True) as (_, host, ports):
        return {name: _read(f"http://{host}:{ports[1]}/{name}") for name in CODE}


def _read(address: str) -> bytes:
    direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with direct.open(address, timeout=READ_TIMEOUT_S) as answer:
        content: bytes = answer.read()
        return content


def viewer_app(code: Mapping[str, bytes], shown: Path | GrowingRecording, token: str, port: int) -> ASGIApp:
    """Return the viewer's app, for requests with the token at this port of the loopback."""

    async def viewer_file(request: Request) -> Response:
        name = request.url.path.rsplit("/", 1)[-1]
        return Response(code[name], media_type=CODE[name])

    async def recording(_: Request) -> Response:
        if isinstance(shown, Path):
            return FileResponse(shown, media_type=RECORDING_TYPE)
        return StreamingResponse(shown.read(), media_type=RECORDING_TYPE)

    files = [Route(f"/{name}", viewer_file) for name in code]
    page = Mount("/", StaticFiles(directory=PAGE, html=True))
    return RequestGuard(Starlette(routes=[Route("/run.rrd", recording), *files, page]), token, port, POLICY)
