"""The servers of robots' gateways within the robots' namespaces: connections are relayed to them."""

import asyncio
import socket
from collections.abc import Sequence
from contextlib import suppress
from threading import Event, Thread
from typing import NamedTuple

from swarmwire.world.interfaces.namespaces import RobotInterface

CHUNK_BYTES = 65_536


class Relay(NamedTuple):
    """A server outside, and where it is to be found within a robot's namespace."""

    interface: RobotInterface
    place: tuple[str, int]
    to: tuple[str, int]


class Relays:
    """Relays of TCP connections, in a thread of their own from the creation until `close`."""

    def __init__(self, relays: Sequence[Relay]) -> None:
        """OSError if a robot has no such address."""
        self._relays = relays
        self._sockets = [
            relay.interface.within(lambda relay=relay: socket.create_server(relay.place)) for relay in relays
        ]
        self._loop = asyncio.new_event_loop()
        self._ended, self._serving = asyncio.Event(), Event()
        self._thread = Thread(target=self._run, name="gateways in namespaces", daemon=True)
        self._thread.start()
        self._serving.wait()

    def close(self) -> None:
        """End all connections; safe to call more than once."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join()

    def _run(self) -> None:
        try:
            with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
                runner.run(self._serve())
        finally:
            self._serving.set()

    async def _serve(self) -> None:
        servers = [
            await asyncio.start_server(lambda reader, writer, to=relay: _relay(to, reader, writer), sock=listening)
            for relay, listening in zip(self._relays, self._sockets, strict=True)
        ]
        self._serving.set()
        await self._ended.wait()
        for server in servers:
            server.close()


async def _relay(to: Relay, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Pass on what comes from either side, until one of them ends."""
    with suppress(OSError):
        server_reader, server_writer = await asyncio.open_connection(*to.to)
        ways = asyncio.create_task(_copy(reader, server_writer)), asyncio.create_task(_copy(server_reader, writer))
        try:
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for way in ways:
                way.cancel()
            server_writer.close()
    writer.close()


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while data := await reader.read(CHUNK_BYTES):
            writer.write(data)
            await writer.drain()
