"""Texts from elsewhere, fit for a terminal and a log."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import robots_text
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.agent_memory import Layout
from swarmwire.comms.wire.join import LIMITS, JoinLimits, JoinRequest, SessionInfo, versioned
from swarmwire.comms.wire.network import Network
from swarmwire.world.backends.allocation import Allocations, S


def printable(text: str, most: int, keep: str = "") -> str:
    r"""The text without what a terminal would obey, but for letters in `keep`, cut to `most` letters.

    >>> printable("flock-0\x1b[2J", 40)
    'flock-0\\x1b[2J'
    >>> printable("flock-0", 4)
    'flo…'
    """
    cut = text if len(text) <= most else text[: most - 1] + "…"
    return "".join(
        letter if letter.isprintable() or letter in keep else letter.encode("unicode_escape").decode() for letter in cut
    )


# --- Where runners meet the world, and who is let in.


@dataclass(frozen=True)
class ListenSettings:
    """The agents' side of a world in the network.

    Attributes:
        endpoints: where it listens.
        network: its certificates; None: none, for this machine alone.
        access: zenoh's access control; None: whoever reaches an endpoint may do anything there.
    """

    endpoints: tuple[str, ...]
    network: Network | None = None
    access: Mapping[str, Any] | None = None


# --- On what terms runners join a run: what they are offered, whether they may come late, and how many.


@dataclass(frozen=True)
class JoinPolicy:
    """What a world asks of its runners.

    Attributes:
        offer: what there is to play; None: nothing is told, and no agent is compared.
        open: whether runners come from elsewhere and when they like: nobody is waited for in vain, and who leaves
            before the first tick only frees its robots.
        start_with: robots with an agent that are enough for the first tick; None: all.
        limits: how many runners, how many robots of each, and how long they may take.
        memory: by group, what is kept of its robots for whoever plays them next; None: nothing is.
    """

    offer: SessionInfo | None = None
    open: bool = False
    start_with: int | None = None
    limits: JoinLimits = LIMITS
    memory: Mapping[str, Layout] | None = None


USUAL = JoinPolicy()  # of runners that the run starts itself


# --- Whether a runner gets the robots that it asks for: its request against what there is, on the run's terms.
#
# Nothing here changes a slot; whoever is refused hears why, in one line.


NAME = re.compile(r"[\w.-]{1,64}", re.ASCII)  # of a runner: it is part of a key, so no wildcard, slash or hash
MAX_SAID = 500  # letters


class JoinRefused(Exception):
    """A request that is not granted; the text goes back to the runner, and `count` says under which name it counts."""

    def __init__(self, text: str, count: str = "refused_join") -> None:
        super().__init__(printable(text, MAX_SAID))
        self.count = count


def read_request(runner: str, request: bytes) -> JoinRequest:
    """What a runner asks for; Refused if it is no request, or if no runner can have this name."""
    try:
        asked = JoinRequest.decode(request)
    except BadFrame as fault:
        raise JoinRefused(str(fault), "bad_join") from fault
    if not NAME.fullmatch(runner):
        raise JoinRefused("expected a name of letters, digits, '_', '-' and '.', 64 at most", "bad_join")
    return asked


def check_version(request: bytes) -> None:
    """Refused if what a runner asks about the run is in another version than ours."""
    try:
        versioned(request)
    except BadFrame as fault:
        raise JoinRefused(str(fault), "bad_join") from fault


def accepted(asked: JoinRequest, slots: Allocations[S], terms: JoinPolicy) -> IntArray:
    """The rows that a runner gets, rising; Refused if what it asks for is not to be had."""
    _check_scenario(asked, terms)
    rows = _rows(asked, slots)
    most = terms.limits.robots_per_runner
    if terms.open and len(rows) > most:
        raise JoinRefused(f"expected at most {most} robots for one runner, got {len(rows)}")
    groups = [group for slot in slots.holding(rows) for group in slot.assignment.groups]
    _check_agents(asked, terms, [group.name for group in groups if np.isin(group.rows, rows).any()])
    return rows


def _rows(asked: JoinRequest, slots: Allocations[S]) -> IntArray:
    free = slots.free
    if asked.names is not None:
        return _named(asked.names, slots)
    if not free:
        raise JoinRefused("all robots are taken")
    if asked.robots is None:
        return np.sort(free[0].all_rows)
    rows = np.sort(np.concatenate([slot.all_rows for slot in free]))[: asked.robots]
    if len(rows) < asked.robots:
        raise JoinRefused(f"expected at most {len(rows)} robots, which are free, got {asked.robots}")
    return rows


def _named(names: Sequence[str], slots: Allocations[S]) -> IntArray:
    """The rows of robots that are free; Refused if one is not, or is none."""
    row_of = slots.row_of
    if not names or len(set(names)) < len(names) or not row_of.keys() >= set(names):
        raise JoinRefused(
            f"expected names of robots, each once ({robots_text(list(row_of))}), got {robots_text(list(names))}"
        )
    rows = np.sort(np.array([row_of[name] for name in names], np.int64))
    for slot in slots.holding(rows):
        if not slot.may("joins"):
            taken = robots_text([name for name in names if row_of[name] in slot.all_rows])
            raise JoinRefused(f"taken, by {slot.runner}: {taken}" if slot.runner else f"given up: {taken}")
    return rows


def _check_scenario(asked: JoinRequest, terms: JoinPolicy) -> None:
    offer = terms.offer
    if offer is not None and asked.scenario_sha256 not in (None, offer.scenario_sha256):
        raise JoinRefused(f"another scenario: here is {offer.scenario!r}, whose file has another sha256")


def _check_agents(asked: JoinRequest, terms: JoinPolicy, groups: Sequence[str]) -> None:
    """The runner's own agents must be those of the run, unless it says nothing of them."""
    if asked.agents is None or terms.offer is None:
        return
    for group in terms.offer.groups:
        got = asked.agents.get(group.name)
        if group.name in groups and got != group.agent_sha256:
            its = "none" if got is None else f"{got[:12]}…"
            here = f"{group.agent} has sha256 {group.agent_sha256[:12]}… here"
            raise JoinRefused(f"another agent for {group.name}: {here}, the runner's own has {its}")
