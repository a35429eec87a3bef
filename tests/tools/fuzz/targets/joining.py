"""Joining a run, and its control: requests, session infos, assignments, live events, the page in a browser."""

from typing import Any, NamedTuple

import msgpack
from hypothesis.strategies import DrawFn
from pydantic import TypeAdapter, ValidationError

from swarmwire.agent.agent import NoAgent
from swarmwire.agent.agent_process import agents_of
from swarmwire.agent.executor import AgentExecutor
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import AgentFailed, BadFrame, BadInput
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.agent_memory import encode_memory
from swarmwire.comms.wire.control_frames import (
    ControlRequest,
    decode_reply,
    decode_request,
    encode_reply,
    encode_request,
)
from swarmwire.comms.wire.join import GroupInfo, JoinRequest, SessionInfo
from swarmwire.deploy.live.page.server import MAX_ORDER_BYTES, Order, execute
from swarmwire.deploy.runs.control_server import ControlServer
from swarmwire.deploy.runs.controls import Controls
from swarmwire.world.backends.join_policy import JoinPolicy, JoinRefused
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.live_events import LiveEvents
from swarmwire.world.scenario_file import scenario_from
from tests.support.agent.hosts import TIMES
from tests.support.agent.runners import assigned_robots
from tests.tools.fuzz.mutations import JSON, TEXTS, one_in, pick
from tests.tools.fuzz.small_run import SCENARIO, small_run
from tests.tools.fuzz.target import DocumentTarget, check_line

SHA256 = "0123456789abcdef" * 4
EVENTS: tuple[dict[str, Any], ...] = (
    {"do": "kill", "robots": {"group": "flock", "share": 0.05}, "for_s": 20.0},
    {"do": "kill", "robots": ["flock-1"]},
    {"do": "partition", "halves": "y", "bridge": ["flock-0"]},
    {"do": "fail", "part": "motors", "robots": {"count": 3}, "for_s": 10},
    {"do": "impulse", "robots": {"count": 1}, "speed_mps": 0.3},
    {"do": "ramp", "what": "radio.loss", "to": 0.5, "over_s": 5.0},
    {"do": "blackout", "robots": {"count": 1}, "for_s": 1.0},
    {"do": "revive", "robots": {"count": 1}},
)
MAX_EVENTS = 500  # of one run, which takes a thousand that wait, and shows two hundred


class NamedRequest(NamedTuple):
    """A request to join, and the name of the runner."""

    runner: str
    data: bytes


class Join(DocumentTarget):
    """Requests to join, and for the session info: a roster allocates robots, or refuses and is as before."""

    name = "join"
    quick = 150
    refusals = (BadFrame, JoinRefused)

    def make_samples(self) -> list[bytes]:
        self.run = small_run()
        own = self.run.assignment.groups
        groups = tuple(GroupInfo(group.name, group.agent, SHA256, len(group.rows), group.robot_names) for group in own)
        session_info = SessionInfo("small-1", "small", SHA256, "0.1.0", 10, None, groups)
        self.terms = JoinPolicy(session_info=session_info, open=True, memory=self.run.layouts)
        agents = {group.name: SHA256 for group in groups}
        return [
            JoinRequest().encode(),
            JoinRequest(robots=2).encode(),
            JoinRequest(names=("flock-1", "scouts-0"), agents=agents).encode(),
            JoinRequest(robots=1, agents=agents, scenario_sha256=SHA256).encode(),
        ]

    def mutated(self, draw: DrawFn) -> Any:
        return NamedRequest(pick(draw, TEXTS) if one_in(draw, 10) else "one", super().mutated(draw))

    def feed(self, case: NamedRequest | bytes) -> None:
        runner, data = case if isinstance(case, NamedRequest) else ("one", case)
        roster = Lockstep([self.run.assignment], "wait", self.terms)
        free = roster.missing_robots
        try:
            roster.session_info(data)
            assignment = assigned_robots(roster.join(runner, data)).assignment
        except JoinRefused:
            if roster.missing_robots != free or roster._by_runner:
                raise AssertionError("refused, and yet robots are allocated") from None
            raise
        if len(assignment.robot_names) + len(roster.missing_robots) != len(free):
            raise AssertionError("robots of no runner, or of two")


class Offers(DocumentTarget):
    """A world's session info as a runner reads it; encoded again, it says the same."""

    name = "session-info"

    def make_samples(self) -> list[bytes]:
        groups = tuple(GroupInfo(name, "a.b:C", SHA256, 3, (f"{name}-0", f"{name}-2")) for name in ("a", "b"))
        session_info = SessionInfo("run-1", "small", SHA256, "0.1.0", 10, None, groups)
        return [session_info.encode(), SessionInfo("run-2", "other", "", "0.1.0", 10, 2.5, ()).encode()]

    def feed(self, case: bytes) -> None:
        info = SessionInfo.decode(case)
        if SessionInfo.decode(info.encode()) != info and info.real_time == info.real_time:
            raise AssertionError("a session info that is not what was read")


class Assignments(DocumentTarget):
    """A world's answer to a runner that joins: robots, bodies, parameters, memory. The runner makes agents of it."""

    name = "assignment"
    inner = ("groups",)
    refusals = (BadFrame, AgentFailed, NoAgent)

    def make_samples(self) -> list[bytes]:
        run = small_run()
        memory = AgentExecutor(run.parts[0]).memory([group.name for group in run.parts[0].groups])
        columns = {name: {column: [*cells] for column, cells in layout.items()} for name, layout in run.layouts.items()}
        memories = ((run.parts[0], encode_memory(memory)), (run.parts[1], None), (run.assignment, encode_memory({})))
        return [
            msgpack.packb({**part.as_mapping(), "v": frames.VERSION, "memory": one, "memory_columns": columns, **TIMES})
            for part, one in memories
        ]

    def feed(self, case: bytes) -> None:
        assigned = assigned_robots(case)
        agents_of(assigned.assignment, assigned.memory)


class Control(DocumentTarget):
    """Requests to a run's control server; one that is refused is refused in one line, and begins nothing."""

    name = "control"
    quick = 150
    refusals = (BadInput,)

    def make_samples(self) -> list[bytes]:
        orders = ("pause",), ("resume",), ("step", 3), ("speed", 2.5), ("speed",)
        requests = [ControlRequest(*order) for order in orders]
        self.scenario = scenario_from(SCENARIO, "small.toml")
        self.bodies = {group.name: group.body for group in small_run().world.static.groups}
        self._start()
        return [*map(encode_request, (*requests, *(ControlRequest("event", event) for event in EVENTS)))]

    def feed(self, case: bytes) -> None:
        if self.taken > MAX_EVENTS:
            self._start()
        before = len(self.live_events._events)
        try:
            self.server.do(decode_request(case))
        except BadInput as error:
            check_line(error)
            if len(self.live_events._events) != before:
                raise AssertionError("refused, and yet an event began") from None
            raise
        self.taken += 1

    def _start(self) -> None:
        self.taken, clock = 0, WallClock()
        self.live_events = LiveEvents(self.scenario, self.bodies)

        class Now:
            tick = 0

        controls = Controls(clock, 10)
        self.server = ControlServer(Now(), controls, self.live_events.submit, self.live_events.end, lambda _: None)


class Replies(DocumentTarget):
    """A run's replies to control and status requests."""

    name = "reply"

    def make_samples(self) -> list[bytes]:
        status = {"run_id": "a", "tick": 3, "ticks": 100, "events": [{"number": 0, "text": "kill"}], "counts": {"x": 1}}
        return [encode_reply({"done": "paused", "tick": 3, "event": None}), encode_reply(status)]

    def feed(self, case: bytes) -> None:
        decode_reply(case)


class AnyRequest:
    """In place of a run: any request can be encoded."""

    def __getattr__(self, do: str) -> Any:
        def request(*value: Any) -> int:
            msgpack.unpackb(encode_request(ControlRequest(do, *value)))
            return 0

        return request


class PageOrders(DocumentTarget):
    """Orders as a browser posts them: JSON, checked by the page's schema, passed on as requests."""

    name = "page"
    codec = JSON
    refusals = (BadInput, ValueError)

    def make_samples(self) -> list[bytes]:
        self.adapter: TypeAdapter[Any] = TypeAdapter(Order)
        orders = [{"do": do} for do in ("pause", "resume", "stop")]
        more = [{"do": "step", "n": 3}, {"do": "speed", "factor": 2.0}, {"do": "end", "number": 1}]
        return [JSON.pack(order) for order in (*orders, *more, *({"do": "event", "event": event} for event in EVENTS))]

    def feed(self, case: bytes) -> None:
        if len(case) > MAX_ORDER_BYTES:
            raise ValueError("too large")  # the page's server takes no more
        try:
            order = self.adapter.validate_json(case)
        except ValidationError as error:
            raise ValueError(error.errors()[0]["type"]) from None
        execute(order, AnyRequest())
