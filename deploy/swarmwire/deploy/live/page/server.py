"""The page of a run: rerun's viewer with controls and fault injection, from a web server on loopback."""

import webbrowser
from collections.abc import AsyncIterable, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import FastAPI, HTTPException
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import FileResponse, JSONResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent
from fastapi.staticfiles import StaticFiles
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from starlette.requests import Request
from starlette.types import ASGIApp

from swarmwire.comms.base.config import check_plain
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.live.drawing import Drawer
from swarmwire.deploy.live.page.news import NewsThread, TickNumbers, facts
from swarmwire.deploy.live.page.serving import RequestGuard, serving
from swarmwire.deploy.live.remote_control import RemoteControl, controlling
from swarmwire.deploy.live.subscription import subscribe
from swarmwire.deploy.live.viewer import AbandonmentDetector, ViewOptions, has_screen
from swarmwire.deploy.runs.live_address import Live

MAX_STEPS = 100_000


def show_page(live: Live, options: ViewOptions, network: Network | None, *, begin: bool) -> None:
    """Show the run until `options.stopped()`, or until all browsers have closed the page of a run that is over.

    RunGone if the run does not answer. `network` has the certificates for a run on another machine. `begin` runs the
    first tick of a run that waits for the page, so that the page has robots to show.
    """
    clock = options.clock
    viewing = replace(options, web=True, port=None).viewer(None)
    with subscribe(live, network) as run, viewing as viewer, controlling(live.endpoint, live.run, network) as control:
        assert viewer.address is not None, "a viewer for browsers has an address"
        seen = TickNumbers(run.scene.static)
        drawer = Drawer(run, viewer.target, options, seen.see)
        drawer.start()
        constants = PageConstants(viewer.address, facts(run.scene))
        news = NewsThread(control, lambda: seen.numbers, clock, lambda: run.over)

        def new_app(token: str, port: int) -> ASGIApp:
            return page_app(control, news, constants, token, port)

        with (
            serving(new_app, clock, options.port) as address,
            closing(news),  # closed before the server, so that no page waits for news
        ):
            news.start()
            options.report(f"open {address} in a browser{'' if begin else '; Ctrl-C ends the page'}")
            if has_screen():
                webbrowser.open(address)
            if begin:
                _first_tick(control)
            departed = AbandonmentDetector(clock, lambda: news.readers)
            while not options.stopped() and drawer.fault is None:
                abandoned = departed()
                if run.over and abandoned:
                    break
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
    """Run a number of ticks, then pause."""

    do: Literal["step"]
    n: int = Field(1, ge=1, le=MAX_STEPS)


class SpeedLimit(_Order):
    """Limit the simulated seconds per second of wall time; None: as fast as possible."""

    do: Literal["speed"]
    factor: float | None = Field(gt=0, le=1e6)


class Happen(_Order):
    """Submit a scenario's event without `at_s`; the run checks it."""

    do: Literal["event"]
    event: dict[str, Any]


class End(_Order):
    """End a lasting event."""

    do: Literal["end"]
    number: int = Field(ge=0, lt=2**63)


Order = Annotated[Go | Step | SpeedLimit | Happen | End, Field(discriminator="do")]
ORDERS: TypeAdapter[Order] = TypeAdapter(Order)


def order_from(body: bytes) -> Order:
    """Parse the order in a request; BadInput names the wrong key.

    Pydantic's parser also refuses input that Python's accepts or fails on: NaN as a number, deep nesting.
    """
    try:
        order = ORDERS.validate_json(body)
    except ValidationError as error:
        fault = error.errors(include_url=False, include_context=False, include_input=False)[0]
        raise BadInput("", ".".join(map(str, fault["loc"])), fault["msg"]) from None
    if isinstance(order, Happen):
        check_plain(order.event, "", "event")
    return order


def execute(order: Order, control: RemoteControl) -> int | None:
    """Send the order to the run; return the number of a new event."""
    match order:
        case Go():
            {"pause": control.pause, "resume": control.resume, "stop": control.stop}[order.do]()
        case Step():
            control.step(order.n)
        case SpeedLimit():
            control.speed(order.factor)
        case End():
            control.end(order.number)
        case Happen():
            return control.event(order.event)
    return None


FILES = Path(__file__).with_name("files")
MAX_ORDER_BYTES = 64 * 1024


@dataclass(frozen=True)
class PageConstants:
    """The constants of a page."""

    viewer: str  # address of rerun's viewer, with its token
    facts: Mapping[str, Any]  # facts of the scene


def page_app(control: RemoteControl, news: NewsThread, constants: PageConstants, token: str, port: int) -> ASGIApp:
    """Return the page's app, for requests with the token at this port of the loopback."""
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None, max_body_size=MAX_ORDER_BYTES)

    @app.get("/")
    async def index() -> FileResponse:
        return FileResponse(FILES / "index.html")

    @app.get("/status")
    async def status() -> dict[str, Any]:
        return news.latest

    @app.get("/news", response_class=EventSourceResponse)
    async def send_news() -> AsyncIterable[ServerSentEvent]:
        data = {**constants.facts, "viewer": constants.viewer, "history": list(news.history)}
        yield ServerSentEvent(event="facts", data=data)
        async for latest in news.read():
            yield ServerSentEvent(event="status", data=latest)

    @app.post("/do")
    async def do(request: Request) -> dict[str, int | None]:
        try:
            order = order_from(await request.body())
        except BadInput as error:
            raise HTTPException(422, str(error)) from None
        number = await run_in_threadpool(execute, order, control)
        news.look()
        return {"event": number}

    @app.exception_handler(SwarmwireError)
    async def refused(_: Request, error: SwarmwireError) -> JSONResponse:
        return JSONResponse({"detail": str(error)}, 409)

    app.mount("/", StaticFiles(directory=FILES))
    origin = "/".join(constants.viewer.split("/")[:3])
    return RequestGuard(app, token, port, f"script-src 'self'; frame-src {origin}; frame-ancestors 'none'")
