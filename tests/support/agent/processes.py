"""Agent processes without processes: the same frames in memory, or the same sockets to threads of this process."""

import socket
import threading
from collections.abc import Sequence
from typing import cast

import numpy as np

from swarmwire.agent.agent_process import ForkServer, agents_of, serve
from swarmwire.agent.process_frames import TickCutter, in_order, read_actions, record_fields
from swarmwire.comms.assignment import Assignment, part_of, split
from swarmwire.comms.packets import ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.tick_io import Actions, Readings
from swarmwire.comms.wire.agent_memory import Memory, memory_in
from swarmwire.comms.wire.frames import decode


class Processes:
    """Robots divided between processes, whose frames stay in memory."""

    def __init__(self, whole: Assignment, processes: int, memory: bytes | None = None) -> None:
        self.whole, self.parts = whole, split(whole, processes)
        self.agents = [agents_of(part, memory) for part in self.parts]
        self._cutter = TickCutter(
            [{group.name: group.rows for group in part.groups} for part in self.parts], whole.measures or ()
        )
        self.memory: list[Memory] = []

    def act(self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses) -> Actions:
        fields = {name: record_fields(group) for name, group in readings.items()}
        answers: list[bytes] = []
        frames = self._cutter.tick(tick, readings, received, tx_status)
        for agents, part, buffers in zip(self.agents, self.parts, frames, strict=True):
            if buffers:
                agents.set_fields({of.name: fields[of.name] for of in part.groups if of.name in fields})
                answers.append(agents.act(b"".join(buffers)))
        actions, rests = read_actions(answers)
        self.memory = [memory_in(decode(rest["memory"])) for rest in rests if "memory" in rest]
        return in_order(actions, np.concatenate([group.rows for group in readings.values()]))

    def on_receive(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> SentPackets:
        frames = self._cutter.packets(tick, at_ns, received, tx_status)
        pairs = zip(self.agents, frames, strict=True)
        actions, _ = read_actions([agents.act(b"".join(buffers)) for agents, buffers in pairs if buffers])
        return actions.sent


def thread_server() -> ForkServer:
    """A `ThreadServer`, as what it stands for."""
    return cast("ForkServer", ThreadServer())


class ThreadServer:
    """A `ForkServer` that starts a thread in place of each process."""

    def __init__(self) -> None:
        self._threads: list[threading.Thread] = []

    def load(self, agents: Sequence[str]) -> None:
        """Nothing: agents are imported in this process."""

    def fork(
        self, assignment: Assignment, rows: Sequence[Sequence[int]], memory: bytes | None = None
    ) -> list[socket.socket]:
        return [self._started(part_of(assignment, np.array(part)), memory) for part in rows]

    def _started(self, part: Assignment, memory: bytes | None) -> socket.socket:
        of_host, of_process = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)

        def play() -> None:
            with of_process:
                serve(of_process, lambda: agents_of(part, memory))

        thread = threading.Thread(target=play, daemon=True)
        thread.start()
        self._threads.append(thread)
        return of_host

    def end(self, process: int) -> str:
        """How a process ended: threads end by themselves, once their socket is closed."""
        return f"thread {process} ended"

    def close(self) -> None:
        for thread in self._threads:
            thread.join(10.0)
