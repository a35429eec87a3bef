"""Admission of runners: the address and the policy of a run, and the check of a join request against them.

`ListenSettings` has the endpoints and access rights, `JoinPolicy` the conditions for runners. `requested_rows` checks
a request against the policy and the free robots. It changes no allocation; a refused runner gets the reason in a line.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.base.printable import printable
from swarmwire.comms.wire.agent_memory import Layout
from swarmwire.comms.wire.assignment import robots_text
from swarmwire.comms.wire.join import JoinRequest, SessionInfo, versioned
from swarmwire.comms.wire.limits import LIMITS, JoinLimits
from swarmwire.comms.wire.network import Network
from swarmwire.world.backends.allocation import Allocations, AllocationT


@dataclass(frozen=True)
class ListenSettings:
    """The address of the world for its runners, and their access rights.

    Attributes:
        endpoints: the endpoints on which the world listens.
        network: certificates of the world; None: no encryption, for this machine alone.
        access: zenoh's access control; None: no restrictions for clients that reach an endpoint.
    """

    endpoints: tuple[str, ...]
    network: Network | None = None
    access: Mapping[str, Any] | None = None


HOST_GRACE_S = 1.0  # a host's time after the time-out of a process to report the loss


@dataclass(frozen=True)
class JoinPolicy:
    """The conditions under which runners join a run.

    Attributes:
        session_info: the session info for runners; None: none is sent, and agents' hashes are not compared.
        open: True if external runners may join at any time. The loss of a runner before the first tick then only frees
            its robots.
        start_with: the number of robots with an agent at which the first tick may begin; None: all.
        limits: the most runners, the most robots of each, and their time-outs.
        memory: layout of the agent memory that the next runner gets, by group; None: memory is not stored.
        timeout_s: a process of a host that does not answer for this time is lost.
        answer_within_s: in real time, the time after which a host sends the answers of its processes so far; None: it
            waits for all.
    """

    session_info: SessionInfo | None = None
    open: bool = False
    start_with: int | None = None
    limits: JoinLimits = LIMITS
    memory: Mapping[str, Layout] | None = None
    timeout_s: float = 10.0
    answer_within_s: float | None = None


DEFAULT_JOIN_POLICY = JoinPolicy()  # policy for local runners, which the run starts


# Name of a runner; it is part of a key, so it has no wildcard, slash or hash.
NAME = re.compile(r"[\w.-]{1,64}", re.ASCII)
MAX_REASON_LETTERS = 500  # longest reason for a refusal


class JoinRefused(Exception):
    """A refused request: the text goes back to the runner, `count` is the name of its counter."""

    def __init__(self, text: str, count: str = "refused_join") -> None:
        super().__init__(printable(text, MAX_REASON_LETTERS))
        self.count = count


def read_request(runner: str, request: bytes) -> JoinRequest:
    """Decode a join request; JoinRefused if it is malformed or the runner's name is not allowed."""
    try:
        parsed = JoinRequest.decode(request)
    except BadFrame as fault:
        raise JoinRefused(str(fault), "bad_join") from fault
    if not NAME.fullmatch(runner):
        raise JoinRefused("expected a name of letters, digits, '_', '-' and '.', 64 at most", "bad_join")
    return parsed


def check_version(request: bytes) -> None:
    """Raise JoinRefused if a request for the session info has another protocol version."""
    try:
        versioned(request)
    except BadFrame as fault:
        raise JoinRefused(str(fault), "bad_join") from fault


def requested_rows(request: JoinRequest, allocations: Allocations[AllocationT], policy: JoinPolicy) -> IntArray:
    """Return the robot rows for a join request, ascending; JoinRefused if it cannot be met."""
    _check_scenario(request, policy)
    rows = _rows(request, allocations)
    max_robots = policy.limits.robots_per_runner
    if policy.open and len(rows) > max_robots:
        raise JoinRefused(f"expected at most {max_robots} robots for one runner, got {len(rows)}")
    groups = [group for allocation in allocations.containing(rows) for group in allocation.assignment.groups]
    _check_agents(request, policy, [group.name for group in groups if np.isin(group.rows, rows).any()])
    return rows


def _rows(request: JoinRequest, allocations: Allocations[AllocationT]) -> IntArray:
    free = allocations.free
    if request.names is not None:
        return _named(request.names, allocations)
    if not free:
        raise JoinRefused("all robots are taken")
    if request.robots is None and allocations.parts > 1:
        return np.sort(free[0].all_rows)
    rows = np.sort(np.concatenate([allocation.all_rows for allocation in free]))[: request.robots]
    if request.robots is not None and len(rows) < request.robots:
        raise JoinRefused(f"expected at most {len(rows)} robots, which are free, got {request.robots}")
    return rows


def _named(names: Sequence[str], allocations: Allocations[AllocationT]) -> IntArray:
    """Return the rows of named robots; JoinRefused if a robot is not free or does not exist."""
    row_of = allocations.row_of
    if not names or len(set(names)) < len(names) or not row_of.keys() >= set(names):
        raise JoinRefused(
            f"expected names of robots, each once ({robots_text(list(row_of))}), got {robots_text(names)}"
        )
    rows = np.sort(np.array([row_of[name] for name in names], np.int64))
    for allocation in allocations.containing(rows):
        if not allocation.allows("joins"):
            robots = robots_text([name for name in names if row_of[name] in allocation.all_rows])
            raise JoinRefused(
                f"taken, by {allocation.runner}: {robots}" if allocation.runner else f"given up: {robots}"
            )
    return rows


def _check_scenario(request: JoinRequest, policy: JoinPolicy) -> None:
    session_info = policy.session_info
    if session_info is not None and request.scenario_sha256 not in (None, session_info.scenario_sha256):
        raise JoinRefused(f"another scenario: here is {session_info.scenario!r}, whose file has another sha256")


def _check_agents(request: JoinRequest, policy: JoinPolicy, groups: Sequence[str]) -> None:
    """Raise JoinRefused if the hash of one of the runner's agents differs; a runner may send no hashes."""
    if request.agents is None or policy.session_info is None:
        return
    for group in policy.session_info.groups:
        runner_sha256 = request.agents.get(group.name)
        if group.name in groups and runner_sha256 != group.agent_sha256:
            runner_text = "none" if runner_sha256 is None else f"{runner_sha256[:12]}…"
            world_text = f"{group.agent} has sha256 {group.agent_sha256[:12]}… here"
            raise JoinRefused(f"another agent for {group.name}: {world_text}, the runner's own has {runner_text}")
