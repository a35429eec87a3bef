"""Frames between a world, its runners and its observers."""

import socket
from typing import Any, NamedTuple

import msgpack
import numpy as np
from hypothesis.strategies import DrawFn

from swarmwire.agent.executor import AgentExecutor
from swarmwire.agent.process_answers import answer_in
from swarmwire.agent.process_frames import MAX_MESSAGE, receive_part, send
from swarmwire.agent.runner_protocol import Ended, PacketsBetween, PacketsReceived, Tick
from swarmwire.comms.base.errors import AgentFailed, BadFrame, Interrupted
from swarmwire.comms.observe.run_views import MetricSeries, ObservedRun, ObservedTick
from swarmwire.comms.robot.tick_io import Readings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.observer_frames import decode_scene, decode_truth, encode_scene, encode_truth
from swarmwire.comms.wire.tick_frames import decode_actions, decode_tick, encode_actions, encode_packets, encode_sent
from swarmwire.world.backends.join_policy import JoinPolicy
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.realtime import RealTime, RealTimeAllocation
from swarmwire.world.backends.registry import RunnerRegistry
from tests.support.agent.hosts import PLAYERS, TIMES
from tests.support.agent.processes import Processes
from tests.support.agent.runners import joining
from tests.tools.fuzz.mutations import one_in, pick
from tests.tools.fuzz.small_run import RUNNERS, joined, readings_of, small_run
from tests.tools.fuzz.target import ByteTarget, FrameTarget
from tests.unit.comms.wire.test_truth_frames import SCENE

TICK = 11  # that is open: the last of the small run
STAGES = ("lockstep", "lockstep", "real time", "real time", "building")


class RunnerFrame(NamedTuple):
    """A frame of a runner, and the stage of the run at which it comes."""

    stage: str
    runner: str
    data: bytes
    carried_out: bool


class WorldFrames(FrameTarget):
    """Frames to a world: actions, sent, ready, failed, leave. A refused one is counted and changes nothing."""

    name = "world-frames"
    quick = 600
    soak = 100_000
    refusals = (BadFrame, AgentFailed, Interrupted)  # the last two: a runner said so

    def make_samples(self) -> list[bytes]:
        self.run = small_run()
        self.valid = {name: answers[-1] for name, answers in self.run.answers.items()}
        self.rosters: dict[str, RunnerRegistry[Any]] = {}
        rows = np.sort(np.concatenate([group.rows for group in self.run.parts[0].groups]))
        sent = decode_actions(frames.decode(self.valid["one"]), rows).sent
        return [
            *(answers[at] for answers in self.run.answers.values() for at in (-1, -2)),
            encode_sent(TICK, sent, missed=1),
            frames.encode("ready", -1, {}),
            frames.encode("failed", -1, {}, {"robots": "flock-0", "traceback": "ValueError\n"}),
            frames.encode("leave", -1, {}),
        ]

    def mutated(self, draw: DrawFn) -> Any:
        stage, runner = pick(draw, STAGES), pick(draw, (*RUNNERS, *RUNNERS, "nobody"))
        # A tick takes a hundred times as long as the rest of a case.
        return RunnerFrame(stage, runner, super().mutated(draw), one_in(draw, 50))

    def feed(self, case: RunnerFrame | bytes) -> str | None:
        case = case if isinstance(case, RunnerFrame) else RunnerFrame("lockstep", "one", case, True)
        roster = self._roster(case.stage)
        try:
            return self._answer(roster, case)
        except BaseException:
            self.rosters.pop(case.stage, None)  # so that the next case finds a new one
            raise

    def _answer(self, roster: Any, case: RunnerFrame) -> str | None:
        before, counted = _state(roster), sum(roster.counts().values())
        roster.answer(case.runner, case.data)
        faults = {name for name in roster.counts() if name.endswith("_frames") and name != "frames_dropped_by_runners"}
        if _state(roster) == before:
            if sum(roster.counts().values()) == counted:
                raise AssertionError("a frame that was neither taken nor counted")
            roster._counts.clear()
            return " ".join(sorted(faults))
        if faults & {"malformed_frames", "oversized_frames", "wrong_tick_frames", "unknown_runner_frames"}:
            raise AssertionError(f"a frame that was refused, and changed the state: {roster.counts()}")
        if case.stage == "building":
            del self.rosters[case.stage]
            return "ready"
        self._close_tick(roster, case)
        return None

    def _close_tick(self, roster: Any, case: RunnerFrame) -> None:
        """Let the other runner answer, take all actions, and open the tick again."""
        other = RUNNERS[1 - RUNNERS.index(case.runner)]
        roster.answer(other, self.valid[other])
        if roster.waiting:  # in real time also packets between ticks are taken
            roster.answer(case.runner, self.valid[case.runner])
        actions = roster.pop_actions()
        if case.carried_out:
            self.run.do(actions)
        roster._counts.clear()
        self._open_tick(roster)

    def _roster(self, stage: str) -> Any:
        if stage not in self.rosters:
            parts, terms = list(self.run.parts), JoinPolicy(memory=self.run.layouts)
            made: Any = RealTime(parts, 0.5, 30.0, "stop", terms, subtick=True) if stage == "real time" else None
            roster = joined(made or Lockstep(parts, policy=terms), ready=stage != "building")
            if stage != "building":
                self._open_tick(roster)
            self.rosters[stage] = roster
        return self.rosters[stage]

    def _open_tick(self, roster: Any) -> None:
        inputs = (self.run.readings, self.run.received, self.run.tx_status)
        roster.open_tick(*((TICK, 0) if isinstance(roster, RealTime) else (TICK,)), *inputs)


def _state(roster: Any) -> Any:
    """All that a frame might change."""
    slots = [
        (slot.runner, slot.state, id(getattr(slot, "actions", None)), id(slot.memory), _unanswered(slot))
        for slot in roster._allocations
    ]
    if isinstance(roster, RealTime):
        arrays = (roster._pending_since_ns, roster._stopped, roster._drive, roster._command, roster.late)
        counts = len(roster._sent), len(roster._answers)
        return slots, [array.tobytes() for array in arrays], counts, dict(roster._frame_numbers)
    return slots, sorted(roster._by_runner), roster._tick


def _unanswered(slot: Any) -> int:
    return len(slot.unanswered) if isinstance(slot, RealTimeAllocation) else 0


class ProcessAnswers(ByteTarget):
    """An agent process's answers to its host, beside an honest one: those that are refused are at fault alone."""

    name = "process-answers"
    quick = 600
    soak = 100_000

    def make_samples(self) -> list[bytes]:
        run = small_run()
        assignment = run.assignment
        self.processes = Processes(assignment, 3, {})
        self.processes.act(TICK, run.readings, run.received, run.tx_status)
        self.honest = self.processes.answers[1:]
        self.rows = self.processes.rows[0]
        return [self.processes.answers[0].data]

    def feed(self, case: bytes) -> str | None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with ours, theirs:
            send(ours, [case or b"\0"])
            frame = receive_part(theirs, [], MAX_MESSAGE)
        if frame is None:
            return "more to come"
        answer = answer_in(0, frame, TICK, self.rows)
        try:
            actions, _ = self.processes.reader.read([answer, *self.honest])
        except BadFrame:
            if self.processes.reader.faults([answer, *self.honest]).keys() != {0}:
                raise AssertionError("another process is at fault") from None
            raise
        decode_actions(frames.decode(encode_actions(TICK, actions)), actions.rows)  # as the world does
        return None


class RunnerFrames(FrameTarget):
    """Frames to a runner: tick, packets, end. The agents can act on those that its protocol takes."""

    name = "runner-frames"
    quick = 250

    def make_samples(self) -> list[bytes]:
        self.run = run = small_run()
        self.executor: AgentExecutor | None = None
        decoded = decode_tick(
            frames.decode(run.frames["one"][-1]), run.assignment.measures or (), readings_of(run.parts, "one")
        )
        self.shapes = _shapes(decoded[0])
        between = encode_packets(11, 1_150_000_000, 3, run.received, run.tx_status)
        end = frames.encode("end", -1, {}, {"why": "it sent far more than it was asked for"})
        self.robots = msgpack.packb({**run.parts[0].as_mapping(), "v": frames.VERSION, "memory": None, **TIMES})
        return [*run.frames["one"][-3:], between, end]

    def feed(self, case: bytes) -> str | None:
        protocol, refused = joining(), None
        protocol.receive_assignment(self.robots)
        protocol.ready()
        protocol.receive_frame(case)
        executor = self.executor = self.executor or AgentExecutor(self.run.parts[0])
        while (event := protocol.next_event()) is not None:
            if isinstance(event, Ended):
                return event.outcome
            self.executor = None  # its agents may now remember what no world sends
            refused = self._act(executor, event)
        return "dropped" if protocol.dropped else refused

    def _act(self, executor: AgentExecutor, event: Tick | PacketsReceived | PacketsBetween) -> str | None:
        """Only the agents' own code may fail, or all that misses a reading that the world does not give."""
        try:
            match event:
                case Tick():
                    executor.act(*event)
                case PacketsReceived():
                    executor.receive(event.received, event.tx_status)
                case PacketsBetween():
                    executor.on_receive(*event)
        except AgentFailed as error:
            lines = [line for line in error.traceback.splitlines() if line.startswith('  File "')]
            if str(PLAYERS) not in lines[-1] and (
                not isinstance(event, Tick) or _shapes(event.readings) == self.shapes
            ):
                raise AssertionError(error.traceback[-1500:]) from error
            return "the agents fail"
        return None


def _shapes(readings: Readings) -> Any:
    return {
        (name, sensor): column.shape[1:] for name, group in readings.items() for sensor, column in group.fields.items()
    }


class Scenes(FrameTarget):
    """Scenes for observers, one with obstacles and a floor."""

    name = "scene"
    inner = ("values",)

    def make_samples(self) -> list[bytes]:
        return [encode_scene(_scene()), encode_scene(SCENE)]

    def feed(self, case: bytes) -> None:
        decode_scene(frames.decode(case))


class Truths(FrameTarget):
    """Ticks for observers; what is decoded can be encoded again."""

    name = "truth"

    def make_samples(self) -> list[bytes]:
        self.scene, truths = _scene(), small_run().truths
        glimpses = [ObservedTick(truth, at, len(truths), np.array([[0.5]])) for at, truth in enumerate(truths)]
        return list(map(encode_truth, glimpses[-3:]))

    def feed(self, case: bytes) -> None:
        encode_truth(decode_truth(frames.decode(case), self.scene))


def _scene() -> ObservedRun:
    static = small_run().world.static
    return ObservedRun(static, (MetricSeries("order", "", (0.0, 1.0)),), static.robot_names[0])
