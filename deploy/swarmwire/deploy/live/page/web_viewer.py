"""Rerun's viewer for a browser, with the recording that it shows, from a web server on loopback.

Rerun's own server would load its page's fonts from elsewhere, and would show its data to every website whose name leads
to this machine. So rerun's program gives only the viewer's code here, and has ended before there is anything to see.
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
CODE = {"re_viewer.js": "text/javascript", "re_viewer_bg.wasm": "application/wasm"}  # with its media types
RECORDING_TYPE = "application/octet-stream"
LIVE_BYTES = 2_000_000_000  # of a live run: then its oldest ticks are dropped
READ_S = 30.0  # for a file of the code
# Frames: the page of a run, which listens at a port of its own. The code is web assembly.
POLICY = f"script-src 'self' 'wasm-unsafe-eval'; frame-ancestors {' '.join(f'http://{host}:*' for host in HOSTS)}"


@contextmanager
def web_viewer(clock: Clock, recording: Path | None, port: int | None = None) -> Generator[Viewer]:
    """A viewer for browsers, with this recording or for what is to come; BadInput if the port is taken."""
    code, tape = viewer_code(clock), Tape(LIVE_BYTES)

    def app(token: str, port: int) -> ASGIApp:
        return viewer_app(code, recording or tape, token, port)

    with serving(app, clock, port) as address, closing(tape):
        yield Viewer(tape.write, address, lambda: True, Departure(clock, lambda: tape.readers))


def viewer_code(clock: Clock) -> dict[str, bytes]:
    """The files of the viewer's code by name. Only rerun's program has them, and gives them as a server."""
    with rerun(clock, [], web=True) as (_, host, ports):
        return {name: _read(f"http://{host}:{ports[1]}/{name}") for name in CODE}


def _read(address: str) -> bytes:
    direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with direct.open(address, timeout=READ_S) as answer:
        content: bytes = answer.read()
        return content


def viewer_app(code: Mapping[str, bytes], shown: Path | Tape, token: str, port: int) -> ASGIApp:
    """The viewer's page, for requests with the token at this port of the loopback."""

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
