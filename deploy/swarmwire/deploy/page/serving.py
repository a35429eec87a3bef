"""The page's web server: in a thread of this process, on loopback, at a port that the system chooses."""

import secrets
import socket
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager

import uvicorn
from starlette.types import ASGIApp

from swarmwire.comms.clock import NS_PER_S, Clock
from swarmwire.comms.errors import BadInput, SwarmwireError

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
