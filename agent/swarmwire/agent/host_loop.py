"""An agent host: it answers the ticks of its world with the actions of agent processes, in lockstep or in real time.

To the world a host is one runner: `RunnerProtocol` decides, `AgentProcesses` act, and `runner` carries the frames.
"""

import select
from collections.abc import Callable
from contextlib import closing
from typing import Protocol

import numpy as np

from swarmwire.agent.fork_server import ForkServer
from swarmwire.agent.host_processes import AgentProcess, AgentProcesses, Lost, ProcessAnswer
from swarmwire.agent.process_answers import in_order
from swarmwire.agent.runner_protocol import (
    WITH_ROBOTS,
    Assigned,
    Ended,
    PacketsBetween,
    PacketsReceived,
    RunnerProtocol,
    Tick,
)
from swarmwire.comms.base.clock import WallClock, to_ns, to_s

CHECK_S = 0.5  # between two checks for silent processes
FAREWELL_TIMEOUT_S = 3.0  # until the world has confirmed that the runner leaves


class FrameSource(Protocol):
    """The arrivals from the world."""

    def fileno(self) -> int:
        """Return the file that is readable once there are arrivals."""
        ...

    def pass_on_all(self, protocol: RunnerProtocol) -> list[bytes]:
        """Pass all arrivals to the protocol; return the frames to put."""
        ...


class AgentHost:
    """The loop of a host, and its answer to the open tick."""

    def __init__(
        self,
        protocol: RunnerProtocol,
        assigned: Assigned,
        server: ForkServer,
        processes: int | None,
        report: Callable[[str], None],
    ) -> None:
        """Fork the processes, or without a number one per robot; `report` prints robots that are lost or restarted."""
        self._protocol, self._clock, self._report = protocol, WallClock(), report
        robots = sum(len(group.rows) for group in assigned.assignment.groups)
        count, now_ns = processes or robots, self._clock.now_ns()
        self._processes = AgentProcesses(server, assigned.assignment, count, assigned.memory, assigned.layouts, now_ns)
        self._restarts = assigned.memory is not None  # the world assigns lost robots again
        self._timeout_ns = to_ns(assigned.timeout_s)
        self._answer_within_ns = None if assigned.answer_within_s is None else to_ns(assigned.answer_within_s)
        self._tick: Tick | None = None  # the open tick
        self._opened_ns = 0
        self._missing: set[AgentProcess] = set()  # processes without an answer to the open tick
        self._answers: list[ProcessAnswer] = []  # answers to the open tick

    def close(self) -> None:
        """End the processes."""
        self._processes.close()

    def run(self, arrivals: FrameSource, put: Callable[[bytes], object]) -> Ended:
        """Answer the world until the end."""
        farewell_end_ns = 0
        with closing(select.epoll()) as files:
            for file in (arrivals.fileno(), self._processes.fileno()):
                files.register(file, select.EPOLLIN)
            while True:
                if self._protocol.state != "leaving":
                    farewell_end_ns = self._clock.now_ns() + to_ns(FAREWELL_TIMEOUT_S)
                elif self._clock.now_ns() > farewell_end_ns:
                    self._protocol.leave()  # the world does not confirm the farewell
                readable = {file for file, _ in files.poll(self._wait_s())}
                if arrivals.fileno() in readable:
                    for data in arrivals.pass_on_all(self._protocol):
                        put(data)
                for data in self._read() + self._check_time():
                    put(data)
                while (event := self._protocol.next_event()) is not None:
                    if isinstance(event, Ended):
                        return event
                    self._act(event)
                    for data in self._complete():
                        put(data)

    def _wait_s(self) -> float:
        """Return the time until the next check."""
        if self._answer_within_ns is None or not self._missing or self._protocol.state != "acting":
            return CHECK_S
        return max(0.0, min(CHECK_S, to_s(self._opened_ns + self._answer_within_ns - self._clock.now_ns())))

    def _act(self, event: Tick | PacketsReceived | PacketsBetween) -> None:
        now_ns = self._clock.now_ns()
        match event:
            case Tick(tick, readings, received, tx_status):
                self._tick, self._answers, self._opened_ns = event, [], now_ns
                self._missing = set(self._processes.tick(tick, now_ns, readings, received, tx_status))
            case PacketsReceived(received, tx_status, tick, at_ns):
                self._processes.packets(tick, at_ns, now_ns, received, tx_status)
            case PacketsBetween():  # the processes have the packets already
                pass

    def _read(self) -> list[bytes]:
        """Read from the processes; return frames for the world."""
        frames: list[bytes] = []
        for event in self._processes.events(self._clock.now_ns()):
            if self._protocol.state not in WITH_ROBOTS:  # the world has ended this runner, or it leaves
                continue
            match event:
                case ProcessAnswer():
                    frames += self._receive_answer(event)
                case Lost():
                    frames.append(self._lose(event))
        if self._protocol.state == "joined" and self._processes.are_ready:
            frames.append(self._protocol.ready(len(self._processes)))
        return frames + self._complete()

    def _receive_answer(self, answer: ProcessAnswer) -> list[bytes]:
        if (
            answer.process in self._missing
            and self._tick is not None
            and answer.tick == self._tick.tick
            and answer.is_step
        ):
            self._missing.discard(answer.process)
            self._answers.append(answer)
            return []
        actions, memory, lost = self._processes.read([answer])
        if lost:
            return [self._lose(process) for process in lost]
        if answer.is_step:  # answers an earlier tick, in real time
            return [self._protocol.answer_late(answer.tick, actions, memory)]
        return [self._protocol.send(answer.tick, actions.sent)] if len(actions.sent) else []

    def _lose(self, lost: Lost) -> bytes:
        process, reason, failed, traceback, ended_itself = lost
        self._missing.discard(process)
        self._answers = [answer for answer in self._answers if answer.process is not process]
        if ended_itself and self._restarts and self._processes.restart(process, self._clock.now_ns()):
            return self._restart_tick(process, reason)
        lines = f"\n{traceback.rstrip()}" if traceback else ""
        self._report(f"lost {process.assignment.robots_text}: {reason}{lines}")
        return self._protocol.lose(process.rows, str(process.number), reason, failed, traceback)

    def _restart_tick(self, process: AgentProcess, reason: str) -> bytes:
        """Send a restarted process the open tick again: its memory is from before that tick."""
        self._report(f"restarted {process.assignment.robots_text}: {reason}")
        if self._tick is not None:
            tick, readings, received, tx_status = self._tick
            now_ns = self._clock.now_ns()
            self._missing |= set(self._processes.tick(tick, now_ns, readings, received, tx_status, process))
        return self._protocol.restart(process.rows, str(process.number), reason)

    def _check_time(self) -> list[bytes]:
        """Lose silent processes; in real time, answer without late ones."""
        now_ns, frames = self._clock.now_ns(), list[bytes]()
        if self._protocol.state not in WITH_ROBOTS:
            return frames
        for process in self._processes.silent(now_ns, self._timeout_ns):
            frames.append(self._lose(self._processes.lose(process, f"no answer for {to_s(self._timeout_ns):g} s")))
        if self._answer_within_ns is not None and now_ns - self._opened_ns >= self._answer_within_ns:
            self._missing.clear()
        return frames + self._complete()

    def _complete(self) -> list[bytes]:
        """Return the answer to the open tick once no process is missing, after the losses of processes at fault."""
        if self._tick is None or self._missing or not self._processes or self._protocol.state != "acting":
            return []
        actions, memory, lost = self._processes.read(self._answers)
        frames = [self._lose(process) for process in lost]
        if not self._processes:
            return frames
        rows = np.concatenate([np.empty(0, np.int64), *(group.rows for group in self._tick.readings.values())])
        self._tick = None
        return [*frames, self._protocol.answer(in_order(actions, rows), memory)]
