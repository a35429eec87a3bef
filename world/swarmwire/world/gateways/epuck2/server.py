"""A thread that serves the connections of all emulated e-puck2s of a group."""

import asyncio
import socket
from collections.abc import Sequence
from threading import Event, Thread

from swarmwire.comms.errors import BadInput
from swarmwire.world.gateways.epuck2.addresses import WHERE
from swarmwire.world.gateways.epuck2.emulated_robot import Connection, EmulatedRobot

BACKLOG = 16


class Server:
    """Sockets that answer from the moment that this is made until `close`."""

    def __init__(self, robots: Sequence[EmulatedRobot], addresses: Sequence[tuple[str, int]]) -> None:
        """BadInput if an address is taken, or not ours to take."""
        self._robots = robots
        self._sockets = _listening(addresses)
        self.addresses: list[tuple[str, int]] = [listening.getsockname()[:2] for listening in self._sockets]
        self._loop = asyncio.new_event_loop()
        self._end = asyncio.Event()
        self._serving = Event()
        self._thread = Thread(target=self._run, name="epuck2 gateway", daemon=True)
        self._thread.start()
        self._serving.wait()

    def live(self, alive: Sequence[bool]) -> None:
        """Which robots are alive from now on."""
        self._loop.call_soon_threadsafe(self._live, alive)

    def tell_unasked(self) -> None:
        """Have the newest readings sent to whoever is connected."""
        self._loop.call_soon_threadsafe(self._tell_unasked)

    def close(self) -> None:
        """Hang up, and free the addresses."""
        self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join()

    def _live(self, alive: Sequence[bool]) -> None:
        for robot, lives in zip(self._robots, alive, strict=True):
            robot.live(lives)

    def _tell_unasked(self) -> None:
        for robot in self._robots:
            robot.tell_unasked()

    def _run(self) -> None:
        try:
            with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
                runner.run(self._serve())
        finally:
            self._serving.set()  # whatever ends the thread, nobody waits for it

    async def _serve(self) -> None:
        servers = [
            await self._loop.create_server(lambda robot=robot: Connection(robot), sock=listening)
            for robot, listening in zip(self._robots, self._sockets, strict=True)
        ]
        self._serving.set()
        await self._end.wait()
        for server in servers:
            server.close()
        for robot in self._robots:
            robot.hang_up()


def _listening(addresses: Sequence[tuple[str, int]]) -> list[socket.socket]:
    """A socket for each address; none stays open if one cannot be had."""
    sockets: list[socket.socket] = []
    for host, port in addresses:
        try:
            sockets.append(socket.create_server((host, port), backlog=BACKLOG))
        except OSError as error:
            for listening in sockets:
                listening.close()
            reason = str(error.strerror or error).partition(" (while")[0]  # the address is said already
            expected = f"expected {host}:{port} to be free, and ours to take: {reason}"
            raise BadInput(WHERE, "address", expected) from error
    return sockets
