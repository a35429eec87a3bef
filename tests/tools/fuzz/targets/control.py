"""What people ask of a run from elsewhere, its answers, and the orders of the page in a browser."""

import json
from typing import Any

import msgpack
from pydantic import TypeAdapter, ValidationError

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.control_frames import Request, decode_reply, encode_reply, encode_request
from swarmwire.deploy.control.control_server import ControlServer
from swarmwire.deploy.controls import Controls
from swarmwire.deploy.page.app import MOST_BYTES
from swarmwire.deploy.page.orders import Order
from swarmwire.world.interventions import Interventions
from swarmwire.world.scenario.scenario_file import scenario_from
from tests.tools.fuzz.miniature import SCENARIO, begun
from tests.tools.fuzz.target import MsgpackTarget, PackedTarget, check_line

EVENTS: tuple[dict[str, Any], ...] = (
    {"do": "kill", "robots": {"group": "flock", "share": 0.05}, "for_s": 20.0},
    {"do": "kill", "robots": ["flock-1"]},
    {"do": "partition", "halves": "y", "bridge": ["flock-0"]},
    {"do": "fail", "part": "motors", "robots": {"count": 3}, "for_s": 10},
    {"do": "push", "robots": {"count": 1}, "speed_mps": 0.3},
    {"do": "ramp", "what": "radio.loss", "to": 0.5, "over_s": 5.0},
    {"do": "blackout", "robots": {"count": 1}, "for_s": 1.0},
    {"do": "revive", "robots": {"count": 1}},
)
RENEWED_AFTER = 500  # events: a run takes a thousand that wait, and tells of two hundred


class Control(MsgpackTarget):
    """Requests, through the run's server to its controls and interventions."""

    name = "control"
    refusals = (BadInput,)
    quick = 500

    def make_samples(self) -> list[bytes]:
        """Each thing that may be asked."""
        asked = [Request("pause"), Request("resume"), Request("step", 3), Request("speed", 2.5), Request("speed")]
        self.scenario = scenario_from(SCENARIO, "miniature.toml")
        self.bodies = {group.name: group.body for group in begun().world.static.groups}
        self._renew()
        return [encode_request(of) for of in (*asked, *(Request("event", event) for event in EVENTS))]

    def door(self, case: bytes) -> None:
        """Do it; what is refused is refused in one line, and begins nothing."""
        if self.given > RENEWED_AFTER:
            self._renew()
        before = len(self.interventions._events)
        try:
            self.server._do(case)
        except BadInput as error:
            check_line(error)
            if len(self.interventions._events) != before:
                raise AssertionError("refused, and yet an event began") from None
            raise
        self.given += 1

    def _renew(self) -> None:
        self.given, clock = 0, WallClock()
        self.interventions = of = Interventions(self.scenario, self.bodies)

        class Now:
            tick = 0

        self.server = ControlServer(Now(), Controls(clock, 10), of.give, of.end, lambda _: None)


class Replies(MsgpackTarget):
    """A run's answers to control and status."""

    name = "reply"

    def make_samples(self) -> list[bytes]:
        """Of control and of status."""
        status = {"run_id": "a", "tick": 3, "ticks": 100, "events": [{"number": 0, "text": "kill"}], "counts": {"x": 1}}
        return [encode_reply({"done": "paused", "tick": 3, "event": None}), encode_reply(status)]

    def door(self, case: bytes) -> None:
        """The decoder."""
        decode_reply(case)


class Page(PackedTarget):
    """Orders as a browser posts them: JSON, checked by the page's schema, handed on as requests."""

    name = "page"
    refusals = (BadInput, ValueError)

    def make_samples(self) -> list[bytes]:
        """Each order."""
        self.adapter: TypeAdapter[Any] = TypeAdapter(Order)
        orders = [{"do": do} for do in ("pause", "resume", "stop")]
        more = [{"do": "step", "n": 3}, {"do": "speed", "factor": 2.0}, {"do": "end", "number": 1}]
        return [self.pack(order) for order in (*orders, *more, *({"do": "event", "event": of} for of in EVENTS))]

    def pack(self, tree: Any) -> bytes:
        """As JSON."""
        return json.dumps(tree).encode()

    def unpack(self, data: bytes) -> Any:
        """From JSON."""
        return json.loads(data)

    def door(self, case: bytes) -> None:
        """The schema, and the request that the run is asked with."""

        class Asked:
            """In place of a run elsewhere."""

            def __getattr__(self, do: str) -> Any:
                def ask(*value: Any) -> int:
                    msgpack.unpackb(encode_request(Request(do, *value)))
                    return 0

                return ask

        if len(case) > MOST_BYTES:
            raise ValueError("too large")  # the page's server takes no more
        try:
            order = self.adapter.validate_json(case)
        except ValidationError as error:
            raise ValueError(error.errors()[0]["type"]) from None
        order.give(Asked())
