"""The door of the page: whoever lacks the secret token, or asks for another site or from one, is refused."""

import hmac
from collections.abc import Mapping

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

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

    def __init__(self, app: ASGIApp, token: str, port: int, frames: str) -> None:
        """`frames` is the origin that the page may show in a frame: the viewer's."""
        self._app, self._token = app, token.encode()
        self._hosts = {f"{host}:{port}" for host in HOSTS}
        self._origins = {f"http://{host}" for host in self._hosts}
        self._closed = closed_to_others(frames)

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


def closed_to_others(frames: str) -> Mapping[str, str]:
    """Headers by which a browser lets the page load nothing but its own, and nobody else show or read it."""
    policy = (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        f"frame-src {frames}; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
    )
    return {
        "Content-Security-Policy": policy,
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Referrer-Policy": "same-origin",
        "Origin-Agent-Cluster": "?1",  # in a process of its own: the viewer in its frame may be slow
        "X-Content-Type-Options": "nosniff",
        "Cache-Control": "no-store",
    }
