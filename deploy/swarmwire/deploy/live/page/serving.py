"""A web server on loopback for one browser's user: it refuses requests without its token."""

import hmac
import secrets
import socket
import threading
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager

import uvicorn
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from swarmwire.comms.base.clock import NS_PER_S, Clock
from swarmwire.comms.base.errors import BadInput, SwarmwireError

START_NS = 20 * NS_PER_S
PAUSE_NS = NS_PER_S // 100
TOKEN_BYTES = 24
MAX_CONNECTIONS = 64


@contextmanager
def serving(new_app: Callable[[str, int], ASGIApp], clock: Clock, port: int | None = None) -> Generator[str]:
    """Serve what `new_app` makes of token and port until the end of the block; the address, with the token in it.

    BadInput if the port is taken.
    """
    with socket.socket() as listening:
        try:
            listening.bind(("127.0.0.1", port or 0))
        except OSError:
            raise BadInput("--port", str(port), "expected a port that is free") from None
        taken: int = listening.getsockname()[1]
        token = secrets.token_urlsafe(TOKEN_BYTES)
        server = uvicorn.Server(_config(new_app(token, taken)))
        thread = threading.Thread(target=server.run, args=([listening],), name="page", daemon=True)
        thread.start()
        try:
            _wait(server, thread, clock)
            yield f"http://127.0.0.1:{taken}/{token}/"
        finally:
            server.should_exit = True
            thread.join()


def _config(app: ASGIApp) -> uvicorn.Config:
    return uvicorn.Config(
        app,
        loop="asyncio",
        http="h11",
        ws="none",
        lifespan="off",
        log_config=None,
        access_log=False,  # it would tell the token
        server_header=False,
        limit_concurrency=MAX_CONNECTIONS,
        timeout_graceful_shutdown=1,
    )


def _wait(server: uvicorn.Server, thread: threading.Thread, clock: Clock) -> None:
    until_ns = clock.now_ns() + START_NS
    while not server.started:
        if not thread.is_alive() or clock.now_ns() > until_ns:
            raise SwarmwireError("the page's web server did not start")
        clock.sleep_until(clock.now_ns() + PAUSE_NS)


HOSTS = ("127.0.0.1", "localhost")  # as browsers on this machine may call it
NO_TOKEN = "refused: open the address that swarmwire printed, with its token"
NO_HOST = "refused: this page is served to 127.0.0.1 alone"
NO_ORIGIN = "refused: asked for by another site"


class Door:
    """Lets requests under /TOKEN/ in, as if they were for /, and closes what comes back against other sites.

    The token in the path comes along with all that the page loads, so that nothing of it is kept in the browser. The
    name under which the page was asked for is checked, since a stranger's name may be made to lead to this machine; the
    origin, since a stranger's page may send what it cannot read.
    """

    def __init__(self, app: ASGIApp, token: str, port: int, policy: str) -> None:
        """`policy` says which scripts and frames the page may load, and who may show it in a frame."""
        self._app, self._token = app, token.encode()
        self._hosts = {f"{host}:{port}" for host in HOSTS}
        self._origins = {f"http://{host}" for host in self._hosts}
        self._closed = closed_to_others(policy)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse the request, or pass it on."""
        if scope["type"] == "lifespan":  # no request, but the server's own start and end
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            raise TypeError(f"the page answers requests alone, not {scope['type']}")
        fault = self._fault(Headers(scope=scope))
        given, slash, rest = scope["path"].removeprefix("/").partition("/")
        if not hmac.compare_digest(given.encode(), self._token):
            fault = fault or NO_TOKEN

        async def closed(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(self._closed)
            await send(message)

        if fault is not None:
            await PlainTextResponse(fault, 403)(scope, receive, closed)
            return
        if not slash:  # what the page loads is named from its folder on
            await RedirectResponse(f"/{given}/")(scope, receive, closed)
            return
        path = f"/{rest}"
        await self._app({**scope, "path": path, "raw_path": path.encode()}, receive, closed)

    def _fault(self, headers: Headers) -> str | None:
        if headers.get("host") not in self._hosts:
            return NO_HOST
        origin = headers.get("origin")
        return NO_ORIGIN if origin is not None and origin not in self._origins else None


def closed_to_others(policy: str) -> Mapping[str, str]:
    """Headers by which a browser lets the page load nothing but its own, and no other site embed or read it."""
    own = "default-src 'none'; style-src 'self'; img-src 'self' data:; connect-src 'self'"
    return {
        "Content-Security-Policy": f"{own}; base-uri 'none'; form-action 'none'; {policy}",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Referrer-Policy": "same-origin",
        "Origin-Agent-Cluster": "?1",  # in a process of its own: the viewer in its frame may be slow
        "X-Content-Type-Options": "nosniff",
        "Cache-Control": "no-store",
    }
