"""A world of six robots with a lossy radio, two runners' worth of agents, and all that crosses between them.

The frames are real: of agents that use all that there is, in a world that goes on.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from swarmwire.agent.host import Host, layout_of
from swarmwire.agent.loading import load_agent
from swarmwire.comms.actuations import Actuations
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.memory import Layout
from swarmwire.comms.notes import Notes
from swarmwire.comms.outcomes import NO_OUTCOMES, Outcomes
from swarmwire.comms.packets import Heard
from swarmwire.comms.senses import Actions, Senses
from swarmwire.comms.truth import Truth
from swarmwire.comms.values import Values
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.join_request import JoinRequest
from swarmwire.comms.wire.tick_frames import decode_tick, encode_actions
from swarmwire.deploy.new_air import new_air
from swarmwire.world.crews.lockstep import Lockstep
from swarmwire.world.crews.split_robots import split, whole
from swarmwire.world.crews.terms import Terms
from swarmwire.world.loop import Loop
from swarmwire.world.scenario.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support.agent.hosts import spec

TICKS = 12
RUNNERS = ("one", "two")
JOIN = JoinRequest().encode()
SCENARIO: dict[str, Any] = {
    "format": 1,
    "name": "miniature",
    "seed": 1,
    "duration_s": 60.0,
    "time": {"rate_hz": 10},
    "arena": {"size_m": [4.0, 4.0], "boundary": "walls"},
    "robots": {
        "flock": {
            "body": "epuck",
            "count": 4,
            "place": {"how": "disc", "radius_m": 0.6},
            "agent": spec("Chatter"),
        },
        "scouts": {
            "body": "epuck",
            "count": 2,
            "place": {"how": "disc", "radius_m": 1.0},
            "agent": spec("VectorEcho"),
        },
    },
    "radio": {
        "model": "disk",
        "range_m": 1.5,
        "loss": 0.1,
        "bit_rate_bps": 250_000,
        "max_payload_bytes": 100,
        "gives": {"range": {"noise_m": 0.02}, "bearing": {"noise_rad": 0.05}},
    },
}


class Miniature:
    """The world, its air, and who plays which robots.

    Attributes:
        parts: the robots of each runner.
        layouts: what is remembered of each group's robots.
        senses: of the last tick; `heard` likewise.
        told: frames to each runner, tick by tick.
        answers: its frames.
        truths: what observers saw.
    """

    def __init__(self) -> None:
        scenario = scenario_from(SCENARIO, "miniature.toml")
        agents = {name: group.agent for name, group in scenario.robots.items()}
        kinds = {name: load_agent(agent) for name, agent in agents.items()}
        self.world = World(scenario, (1,), {name: kind.needs for name, kind in kinds.items()})
        self.loop = Loop(self.world, new_air(scenario, self.world, None), self, ())
        self.whole = whole(scenario, self.world.static, agents)
        self.parts: Sequence[Assignment] = split(self.whole, len(RUNNERS))
        self.layouts: Mapping[str, Layout] = {name: layout_of(kind) for name, kind in kinds.items()}
        self.senses: Senses = {}
        self.heard = Heard.none()
        self.outcomes: Outcomes = NO_OUTCOMES
        self.told: dict[str, list[bytes]] = {name: [] for name in RUNNERS}
        self.answers: dict[str, list[bytes]] = {name: [] for name in RUNNERS}
        self.truths: list[Truth] = []
        self.given: Actions | None = None  # in place of what the agents would do
        self._hosts = dict(zip(RUNNERS, map(Host, self.parts), strict=True))
        self._roster = playing(Lockstep(list(self.parts), terms=Terms(memory=self.layouts)))

    def do(self, actions: Actions) -> Truth:
        """A tick in which the robots do this."""
        self.given = actions
        return self.loop.step()

    def act(self, tick: int, senses: Senses, heard: Heard, outcomes: Outcomes = NO_OUTCOMES) -> Actions:
        """What the robots do: as a crew."""
        if self.given is not None:
            return self.given
        self.senses, self.heard, self.outcomes = senses, heard, outcomes
        for runner, data in self._roster.open_tick(tick, senses, heard, outcomes):
            self.told[runner].append(data)
            answer = self._answer(runner, data)
            self.answers[runner].append(answer)
            self._roster.answer(runner, answer)
        assert not self._roster.counts()
        return self._roster.take()

    def counts(self) -> dict[str, int]:
        """Nothing is wrong with it: as a crew."""
        return {}

    def _answer(self, runner: str, data: bytes) -> bytes:
        host, frame = self._hosts[runner], frames.decode(data)
        senses, heard, outcomes = decode_tick(frame, self.whole.gives or (), senses_of(self.parts, runner))
        actions = host.act(frame.tick, senses, heard, outcomes)
        return encode_actions(frame.tick, with_all(actions), memory=host.memory(senses))


@cache
def begun() -> Miniature:
    """The miniature after its first ticks, the same for all who only look at it."""
    made = Miniature()
    made.truths = [made.loop.step() for _ in range(TICKS)]
    return made


def playing(roster: Any, *, ready: bool = True) -> Any:
    """A roster whose runners have joined, and built their agents."""
    for name in RUNNERS:
        roster.join(name, JOIN)
        if ready:
            roster.answer(name, frames.encode("ready", -1, {}))
    return roster


def with_all(actions: Actions) -> Actions:
    """Actions with all that agents may do beside: a note, an actuator of their own, a number that is told."""
    one = actions.rows[:1]
    note = Notes(one, np.zeros(1, np.int64), ("searching",))
    own = Actuations(one, np.zeros(1, np.int64), np.array([0.5]))
    return replace(actions, notes=note, own=own, values=Values(one, np.array([1.5])))


def senses_of(parts: Sequence[Assignment], runner: str) -> set[str]:
    """The groups that a runner plays robots of."""
    return {group.name for group in parts[RUNNERS.index(runner)].groups}
