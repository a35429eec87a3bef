"""The page's routes: its files, the news of the run, and the orders that people give."""

from collections.abc import AsyncIterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from fastapi import Body, FastAPI
from fastapi.responses import FileResponse, JSONResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent
from fastapi.staticfiles import StaticFiles
from starlette.requests import Request
from starlette.types import ASGIApp

from swarmwire.comms.errors import SwarmwireError
from swarmwire.deploy.control.remote_control import RemoteControl
from swarmwire.deploy.page.door import Door
from swarmwire.deploy.page.news import NewsThread
from swarmwire.deploy.page.orders import Order

FILES = Path(__file__).with_name("files")
MAX_BYTES = 64 * 1024  # of an order


@dataclass(frozen=True)
class Shown:
    """What the page shows that does not change."""

    viewer: str  # the address of rerun's pages, but for what they show
    stream: str  # what they show
    facts: Mapping[str, Any]  # of the scene


def page_app(control: RemoteControl, news: NewsThread, shown: Shown, token: str, port: int) -> ASGIApp:
    """The page, for whoever asks with the token at this port of the loopback."""
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None, max_body_size=MAX_BYTES)

    @app.get("/")
    async def index() -> FileResponse:
        return FileResponse(FILES / "index.html")

    @app.get("/status")
    async def status() -> dict[str, Any]:
        return news.latest

    @app.get("/news", response_class=EventSourceResponse)
    async def tell() -> AsyncIterable[ServerSentEvent]:
        facts = {**shown.facts, "viewer": shown.viewer, "stream": shown.stream, "history": list(news.history)}
        yield ServerSentEvent(event="facts", data=facts)
        async for latest in news.read():
            yield ServerSentEvent(event="status", data=latest)

    @app.post("/do")
    def do(order: Annotated[Order, Body()]) -> dict[str, int | None]:
        number = order.give(control)
        news.look()
        return {"event": number}

    @app.exception_handler(SwarmwireError)
    async def refused(_: Request, error: SwarmwireError) -> JSONResponse:
        return JSONResponse({"detail": str(error)}, 409)

    app.mount("/", StaticFiles(directory=FILES))
    return Door(app, token, port, shown.viewer)
