"""The page of a run: rerun's viewer with controls and fault injection beside it, from a web server on loopback.

The server refuses requests without its token.
"""

import hmac
import secrets
import socket
import threading
import webbrowser
from collections.abc import AsyncIterable, Callable, Generator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import uvicorn
from fastapi import FastAPI, HTTPException
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import FileResponse, JSONResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent
from fastapi.staticfiles import StaticFiles
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from swarmwire.comms.clock import NS_PER_S, Clock
from swarmwire.comms.config import check_plain
from swarmwire.comms.errors import BadInput, SwarmwireError
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.live.following import Live, following
from swarmwire.deploy.live.remote_control import RemoteControl, controlling
from swarmwire.deploy.live.viewer import Drawer, ViewOptions, has_screen
from swarmwire.deploy.page.news import NewsThread, Seen, facts

MAX_STEPS = 100_000
START_NS = 20 * NS_PER_S
PAUSE_NS = NS_PER_S // 100
TOKEN_BYTES = 24
MAX_CONNECTIONS = 64


def show_page(live: Live, options: ViewOptions, network: Network | None = None, *, begin: bool = False) -> None:
    """Show the run until `options.stopped()` or its viewer is gone; RunGone if the run does not answer.

    `network` brings the certificates that a run on another machine asks for. With `begin` the first tick of a run that
    waits for the page is asked for: without it there would be nothing to see.
    """
    clock = options.clock
    viewing = replace(options, web=True, port=None).viewer(None)
    with following(live, network) as run, viewing as shown, controlling(live.endpoint, live.run, network) as control:
        assert shown.web is not None, "a viewer with pages was asked for"
        seen = Seen(run.scene.static)
        drawer = Drawer(run, shown.url, options, seen.see)
        drawer.start()
        told = Shown(shown.web, shown.url, facts(run.scene))
        news = NewsThread(control, lambda: seen.numbers, clock, lambda: run.over)
        with (
            serving(lambda token, port: page_app(control, news, told, token, port), clock, options.port) as address,
            closing(news),  # first, so that no page waits for more
        ):
            news.start()
            options.say(f"open {address} in a browser{'' if begin else '; Ctrl-C ends the page'}")
            if has_screen():
                webbrowser.open(address)
            if begin:
                _first_tick(control)
            while shown.alive and not options.stopped() and drawer.fault is None:
                options.pause()
    if drawer.fault is not None:
        raise drawer.fault


def _first_tick(control: RemoteControl) -> None:
    status = control.status()
    if status["state"] == "paused" and status["tick"] == 0:
        control.step()


class _Order(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Go(_Order):
    """Pause, resume or end the run."""

    do: Literal["pause", "resume", "stop"]


class Step(_Order):
    """So many ticks, then the run pauses."""

    do: Literal["step"]
    n: int = Field(1, ge=1, le=MAX_STEPS)


class Speed(_Order):
    """At most so many simulated seconds per second of wall time; None: as fast as possible."""

    do: Literal["speed"]
    factor: float | None = Field(gt=0, le=1e6)


class Happen(_Order):
    """Something happens: a scenario's event without `at_s`, which the run itself checks."""

    do: Literal["event"]
    event: dict[str, Any]


class End(_Order):
    """Something that lasts is over."""

    do: Literal["end"]
    number: int = Field(ge=0, lt=2**63)


Order = Annotated[Go | Step | Speed | Happen | End, Field(discriminator="do")]
ORDERS: TypeAdapter[Order] = TypeAdapter(Order)


def order_from(body: bytes) -> Order:
    """The order in a request; BadInput names the key that does not fit.

    The reader is pydantic's, which refuses also what Python's takes or fails at: NaN as a number, deep nesting.
    """
    try:
        order = ORDERS.validate_json(body)
    except ValidationError as error:
        fault = error.errors(include_url=False, include_context=False, include_input=False)[0]
        raise BadInput("", ".".join(map(str, fault["loc"])), fault["msg"]) from None
    if isinstance(order, Happen):
        check_plain(order.event, "", "event")
    return order


def give(order: Order, control: RemoteControl) -> int | None:
    """Ask the run for it; the number of the event that it began, if any."""
    match order:
        case Go():
            {"pause": control.pause, "resume": control.resume, "stop": control.stop}[order.do]()
        case Step():
            control.step(order.n)
        case Speed():
            control.speed(order.factor)
        case End():
            control.end(order.number)
        case Happen():
            return control.event(order.event)
    return None


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


FILES = Path(__file__).with_name("files")
MAX_BYTES = 64 * 1024  # of an order


@dataclass(frozen=True)
class Shown:
    """What the page shows that does not change."""

    viewer: str  # the address of rerun's pages, but for what they show
    stream: str  # what they show
    facts: Mapping[str, Any]  # of the scene


def page_app(control: RemoteControl, news: NewsThread, shown: Shown, token: str, port: int) -> ASGIApp:
    """The page, for requests with the token at this port of the loopback."""
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None, max_body_size=MAX_BYTES)

    @app.get("/")
    async def index() -> FileResponse:
        return FileResponse(FILES / "index.html")

    @app.get("/status")
    async def status() -> dict[str, Any]:
        return news.latest

    @app.get("/news", response_class=EventSourceResponse)
    async def tell() -> AsyncIterable[ServerSentEvent]:
        constants = {**shown.facts, "viewer": shown.viewer, "stream": shown.stream, "history": list(news.history)}
        yield ServerSentEvent(event="facts", data=constants)
        async for latest in news.read():
            yield ServerSentEvent(event="status", data=latest)

    @app.post("/do")
    async def do(request: Request) -> dict[str, int | None]:
        try:
            order = order_from(await request.body())
        except BadInput as error:
            raise HTTPException(422, str(error)) from None
        number = await run_in_threadpool(give, order, control)
        news.look()
        return {"event": number}

    @app.exception_handler(SwarmwireError)
    async def refused(_: Request, error: SwarmwireError) -> JSONResponse:
        return JSONResponse({"detail": str(error)}, 409)

    app.mount("/", StaticFiles(directory=FILES))
    return Door(app, token, port, shown.viewer)


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
    """Headers by which a browser lets the page load nothing but its own, and no other site embed or read it."""
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
