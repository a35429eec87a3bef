"""How runners and worlds find together: what a runner asks for, what a world offers, and the robots that it gives."""

from typing import Any, NamedTuple

import msgpack

from swarmwire.agent.host import Host
from swarmwire.agent.loading import NoAgent
from swarmwire.agent.runner import given_robots
from swarmwire.comms.errors import AgentFailed, BadFrame
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.join_request import JoinRequest
from swarmwire.comms.wire.memory_frames import encode_memory
from swarmwire.comms.wire.offer import Offer, OfferedGroup
from swarmwire.world.crews.admission import Refused
from swarmwire.world.crews.lockstep import Lockstep
from swarmwire.world.crews.terms import Terms
from tests.tools.fuzz.dice import Dice
from tests.tools.fuzz.magic import TEXTS
from tests.tools.fuzz.miniature import begun
from tests.tools.fuzz.target import MsgpackTarget

SHA256 = "0123456789abcdef" * 4


class Asked(NamedTuple):
    """A request, and the name under which it comes."""

    runner: str
    data: bytes


class Join(MsgpackTarget):
    """Requests to join, and for the offer; each at a roster without runners."""

    name = "join"
    refusals = (BadFrame, Refused)
    quick = 500

    def make_samples(self) -> list[bytes]:
        """Every kind of request."""
        self.miniature = begun()
        groups = tuple(
            OfferedGroup(group.name, group.agent, SHA256, len(group.rows), group.robot_names)
            for group in self.miniature.whole.groups
        )
        offer = Offer("miniature-1", "miniature", SHA256, "0.1.0", 10, None, groups)
        self.terms = Terms(offer=offer, open=True, memory=self.miniature.layouts)
        agents = {group.name: SHA256 for group in groups}
        return [
            JoinRequest().encode(),
            JoinRequest(robots=2).encode(),
            JoinRequest(names=("flock-1", "scouts-0"), agents=agents).encode(),
            JoinRequest(robots=1, agents=agents, scenario_sha256=SHA256).encode(),
        ]

    def case(self, dice: Dice) -> Any:
        """A changed request, now and then under a strange name."""
        return Asked(dice.pick(TEXTS) if dice.chance(0.1) else "one", super().case(dice))

    def door(self, case: Any) -> str | None:
        """The roster: it gives robots that can be played, or refuses and is as before."""
        runner, data = case if isinstance(case, Asked) else Asked("one", case)
        roster = Lockstep([self.miniature.whole], "wait", self.terms)
        free = roster.missing_robots
        try:
            roster.offer(data)
            assignment, _ = given_robots(roster.join(runner, data))
        except Refused:
            if roster.missing_robots != free or roster._by_runner:
                raise AssertionError("refused, and yet robots are given") from None
            raise
        if len(assignment.robot_names) + len(roster.missing_robots) != len(free):
            raise AssertionError("robots that nobody has, or two")
        return None


class Offered(MsgpackTarget):
    """A world's offer, as a runner reads it."""

    name = "offer"

    def make_samples(self) -> list[bytes]:
        """An offer, and one in real time without any robot."""
        groups = tuple(OfferedGroup(name, "a.b:C", SHA256, 3, (f"{name}-0", f"{name}-2")) for name in ("a", "b"))
        offer = Offer("run-1", "miniature", SHA256, "0.1.0", 10, None, groups)
        return [offer.encode(), Offer("run-2", "other", "", "0.1.0", 10, 2.5, ()).encode()]

    def door(self, case: bytes) -> None:
        """The decoder; what it gives says the same again."""
        offer = Offer.decode(case)
        if Offer.decode(offer.encode()) != offer and offer.real_time == offer.real_time:
            raise AssertionError("an offer that is not what was read")


class Given(MsgpackTarget):
    """A world's answer to a runner that joins: robots, their bodies and parameters, and what is remembered of them."""

    name = "given"
    inner = ("groups",)
    refusals = (BadFrame, AgentFailed, NoAgent)

    def make_samples(self) -> list[bytes]:
        """Answers for both runners, with and without memory."""
        of = begun()
        memory = Host(of.parts[0]).memory([group.name for group in of.parts[0].groups])
        kept = (encode_memory(memory), None, encode_memory({}))
        parts = (of.parts[0], of.parts[1], of.whole)
        return [
            msgpack.packb({**part.as_mapping(), "v": frames.VERSION, "memory": one})
            for part, one in zip(parts, kept, strict=True)
        ]

    def door(self, case: bytes) -> None:
        """What the runner takes, and the agents that it makes of it."""
        Host(*given_robots(case))
