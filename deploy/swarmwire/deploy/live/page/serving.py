"""A web server on loopback for the user's browsers: it refuses requests without its token."""

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

START_TIMEOUT_NS = 20 * NS_PER_S
POLL_NS = NS_PER_S // 100
TOKEN_BYTES = 24
MAX_CONNECTIONS = 64


@contextmanager
def serving(new_app: Callable[[str, int], ASGIApp], clock: Clock, port: int | None = None) -> Generator[str]:
    """Serve `new_app(token, port)` until the end of the block, and yield the address with the token.

    BadInput if the port is taken.
    """
    with socket.socket() as listening:
        try:
            listening.bind(("127.0.0.1", port or 0))
        except OSError:
            raise BadInput("--port", str(port), "expected a port that is free") from None
        bound_port: int = listening.getsockname()[1]
        token = secrets.token_urlsafe(TOKEN_BYTES)
        server = uvicorn.Server(_config(new_app(token, bound_port)))
        thread = threading.Thread(target=server.run, args=([listening],), name="page", daemon=True)
        thread.start()
        try:
            _wait(server, thread, clock)
            yield f"http://127.0.0.1:{bound_port}/{token}/"
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
        access_log=False,  # a log of requests would reveal the token
        server_header=False,
        limit_concurrency=MAX_CONNECTIONS,
        timeout_graceful_shutdown=1,
    )


def _wait(server: uvicorn.Server, thread: threading.Thread, clock: Clock) -> None:
    deadline_ns = clock.now_ns() + START_TIMEOUT_NS
    while not server.started:
        if not thread.is_alive() or clock.now_ns() > deadline_ns:
            raise SwarmwireError("the page's web server did not start")
        clock.sleep_until(clock.now_ns() + POLL_NS)


HOSTS = ("127.0.0.1", "localhost")  # host names in requests of browsers on this machine
NO_TOKEN = "refused: open the address that swarmwire printed, with its token"
NO_HOST = "refused: this page is served only to 127.0.0.1"
NO_ORIGIN = "refused: request from another site"


class RequestGuard:
    """Middleware that passes requests under /TOKEN/ on as requests for /, and protects responses from other sites.

    The token in the path is part of all relative links of the page, so the browser stores no cookie. The host name of a
    request is checked against DNS rebinding; the origin against requests of other sites' pages.
    """

    def __init__(self, app: ASGIApp, token: str, port: int, policy: str) -> None:
        """`policy` is the part of the content security policy on scripts and frames."""
        self._app, self._token = app, token.encode()
        self._hosts = {f"{host}:{port}" for host in HOSTS}
        self._origins = {f"http://{host}" for host in self._hosts}
        self._headers = security_headers(policy)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse the request, or pass it on."""
        if scope["type"] == "lifespan":  # start and end of the server
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            raise TypeError(f"the page answers only HTTP requests, not {scope['type']}")
        fault = self._fault(Headers(scope=scope))
        token, slash, suffix = scope["path"].removeprefix("/").partition("/")
        if not hmac.compare_digest(token.encode(), self._token):
            fault = fault or NO_TOKEN

        async def send_protected(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(self._headers)
            await send(message)

        if fault is not None:
            await PlainTextResponse(fault, 403)(scope, receive, send_protected)
            return
        if not slash:  # links of the page are relative to a folder
            await RedirectResponse(f"/{token}/")(scope, receive, send_protected)
            return
        path = f"/{suffix}"
        await self._app({**scope, "path": path, "raw_path": path.encode()}, receive, send_protected)

    def _fault(self, headers: Headers) -> str | None:
        if headers.get("host") not in self._hosts:
            return NO_HOST
        origin = headers.get("origin")
        return NO_ORIGIN if origin is not None and origin not in self._origins else None


def security_headers(policy: str) -> Mapping[str, str]:
    """Return headers that restrict the page to its own files, and forbid other sites to embed or read it."""
    sources = "default-src 'none'; style-src 'self'; img-src 'self' data:; connect-src 'self'"
    return {
        "Content-Security-Policy": f"{sources}; base-uri 'none'; form-action 'none'; {policy}",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Referrer-Policy": "same-origin",
        "Origin-Agent-Cluster": "?1",  # a separate process, since the viewer in the frame may be slow
        "X-Content-Type-Options": "nosniff",
        "Cache-Control": "no-store",
    }
