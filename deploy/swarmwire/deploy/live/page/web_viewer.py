"""Rerun's viewer for a browser, with its recording, from a web server on loopback.

Rerun's own server would load fonts from other servers, and its data would be open to websites by DNS rebinding. So
rerun's program only provides the viewer's code, and has ended before the run is shown.
"""

import urllib.request
from collections.abc import Generator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp

from swarmwire.comms.base.clock import Clock
from swarmwire.deploy.live.page.serving import HOSTS, Door, serving
from swarmwire.deploy.live.page.tape import Tape
from swarmwire.deploy.live.viewer import Departure, Viewer, rerun

PAGE = Path(__file__).with_name("viewer")
CODE = {"re_viewer.js": "text/javascript", "re_viewer_bg.wasm": "application/wasm"}  # media types by file
RECORDING_TYPE = "application/octet-stream"
LIVE_BYTES = 2_000_000_000  # recording of a live run; beyond it the oldest ticks are dropped
READ_TIMEOUT_S = 30.0
# The page of a run, at another port, shows the viewer in a frame. The code is web assembly.
POLICY = f"script-src 'self' 'wasm-unsafe-eval'; frame-ancestors {' '.join(f'http://{host}:*' for host in HOSTS)}"


@contextmanager
def web_viewer(clock: Clock, recording: Path | None, port: int | None = None) -> Generator[Viewer]:
    """Yield a viewer for browsers, with this recording or for a live run; BadInput if the port is in use."""
    code, tape = viewer_code(clock), Tape(LIVE_BYTES)

    def app(token: str, port: int) -> ASGIApp:
        return viewer_app(code, recording or tape, token, port)

    with serving(app, clock, port) as address, closing(tape):
        yield Viewer(tape.write, address, lambda: True, Departure(clock, lambda: tape.readers))


def viewer_code(clock: Clock) -> dict[str, bytes]:
    """Return the files of the viewer's code by name, from rerun's program as a server."""
    with rerun(clock, [], web=True) as (_, host, ports):
        return {name: _read(f"http://{host}:{ports[1]}/{name}") for name in CODE}


def _read(address: str) -> bytes:
    direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with direct.open(address, timeout=READ_TIMEOUT_S) as answer:
        content: bytes = answer.read()
        return content


def viewer_app(code: Mapping[str, bytes], shown: Path | Tape, token: str, port: int) -> ASGIApp:
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
    return Door(Starlette(routes=[Route("/run.rrd", recording), *files, page]), token, port, POLICY)
