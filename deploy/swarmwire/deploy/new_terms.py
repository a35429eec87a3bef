"""From a scenario and its agents to the terms on which runners join."""

import hashlib
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

from swarmwire.agent.agent import agent_sha256, load_agent
from swarmwire.agent.host import layout_of
from swarmwire.comms.truth import Static
from swarmwire.comms.wire.join import GroupInfo, SessionInfo
from swarmwire.deploy.listening import Listening
from swarmwire.world.backends.join_policy import JoinPolicy
from swarmwire.world.scenario.scenario import Scenario

KEPT = ("wait", "stand", "coast")  # where another runner may take over


def new_terms(
    scenario: Scenario,
    static: Static,
    agents: Mapping[str, str],
    run_id: str,
    factor: float | None,
    listening: Listening | None,
) -> JoinPolicy:
    """The terms of a run in real time at this factor, or in lockstep; `agents` names, by group, the agent's spec."""
    kinds = {group: load_agent(spec) for group, spec in agents.items()}
    memory = {group: layout_of(kind) for group, kind in kinds.items()}
    kept = memory if scenario.run.on_runner_loss in KEPT else None
    if listening is None:
        return JoinPolicy(memory=kept)
    groups = tuple(
        GroupInfo(
            name=group.name,
            agent=scenario.robots[group.name].agent,
            agent_sha256=agent_sha256(kinds[group.name]),
            robots=(group.stop - group.start) * static.arenas,
            free=(),
        )
        for group in static.groups
    )
    session_info = SessionInfo(
        run=run_id,
        scenario=scenario.name,
        scenario_sha256=_sha256(scenario.source),
        swarmwire=version("swarmwire-deploy"),
        rate_hz=static.rate_hz,
        real_time=factor,
        groups=groups,
    )
    return JoinPolicy(session_info, True, listening.start_with, listening.limits, kept)


def _sha256(source: str) -> str:
    """Of the scenario's file; "" if it was made in Python."""
    path = Path(source)
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
