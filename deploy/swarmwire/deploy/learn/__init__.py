"""Environments for learning: a PettingZoo ParallelEnv of an arena, and a Gymnasium VectorEnv of many arenas.

    >>> from swarmwire.deploy.learn import vector_env
    >>> envs = vector_env("flocking.toml", arenas=64, reward="order")  # doctest: +SKIP

Observations and actions of policies are defined in `swarmwire.agent.policy_io`, which robots also use.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarmwire.agent.policy_io import PolicyIO, PolicyLayout
from swarmwire.comms.base.extras import LEARN
from swarmwire.deploy.learn.options import ArenaState, Choice, EnvOptions, Uniform
from swarmwire.metrics.measures.measure import Condition

if TYPE_CHECKING:
    from swarmwire.deploy.learn.environments import Autoreset, SwarmParallelEnv, SwarmVectorEnv

__all__ = [
    "ArenaState",
    "Choice",
    "Condition",
    "EnvOptions",
    "PolicyIO",
    "PolicyLayout",
    "Uniform",
    "parallel_env",
    "vector_env",
]


def parallel_env(scenario: Path | str | Mapping[str, Any], **options: Any) -> "SwarmParallelEnv":
    """Return an arena of a scenario as a PettingZoo ParallelEnv; `options` are the fields of `EnvOptions`.

    `scenario` is a file, or the content of a file as a mapping. BadInput for an invalid scenario or option.
    """
    LEARN.need("learn")
    from swarmwire.deploy.learn.environments import SwarmParallelEnv

    return SwarmParallelEnv(scenario, EnvOptions(**options))


def vector_env(
    scenario: Path | str | Mapping[str, Any], arenas: int, *, autoreset: "Autoreset" = "next_step", **options: Any
) -> "SwarmVectorEnv":
    """Return a number of arenas of a scenario as a Gymnasium VectorEnv; `options` are the fields of `EnvOptions`.

    `autoreset` is Gymnasium's mode: an arena that is over begins its next episode in the next step, which ignores its
    action, or in the same step, or waits for a reset. `scenario` and errors are those of `parallel_env`.
    """
    LEARN.need("learn")
    from swarmwire.deploy.learn.environments import SwarmVectorEnv

    return SwarmVectorEnv(scenario, arenas, autoreset, EnvOptions(**options))
