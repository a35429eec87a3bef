"""Trains a policy for all robots of a swarm by PPO, with or without packet loss, and saves it as an agent.

    python examples/learn/train.py flocking --loss 0 0.3 0.6 0.9 --out flock.onnx

All robots share one network, and each sees and sets its own numbers (docs/learn.md). Losses are drawn again for each
episode of each arena. The tutorial docs/tutorial-learn.md explains this file; it needs torch and onnxscript.

Source: J. Schulman et al., Proximal Policy Optimization Algorithms, arXiv:1707.06347 (2017).
"""

# pyright: basic, reportMissingImports=false

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from swarmwire.agent.onnx_policy import save_policy
from swarmwire.agent.policy_io import PolicyLayout
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.deploy.learn import ArenaState, Choice, vector_env

FOLDER = Path(__file__).parent
TICK_S = 0.1
SPEED_MPS = 0.1  # as the hand-written rules
NEAR_M = 0.2  # between centres
AT_LIGHT_M = 0.5

ARENAS = 64
EPISODE = 300  # steps; shorter than the scenarios, since most is to be learned at the start
ROLLOUT = 50  # steps of each arena between two updates of the network
EPOCHS = 4  # passes over a rollout
BATCHES = 8  # of a pass
LEARNING_RATE = 1e-3  # at first; it falls to 0
LAMBDA = 0.95  # of the generalised advantage estimation
CLIP = 0.2  # of the ratio of probabilities
MAX_GRADIENT = 0.5
FIRST_STD = 0.6  # of actions
CONSTANT = 0.02  # numbers with a smaller standard deviation are not scaled
MAX_SCALED = 5.0
HIDDEN = 32  # units in each of two layers


def crowding(state: ArenaState) -> FloatArray:
    """By how much others are nearer than `NEAR_M` to each robot, summed, (arenas, robots)."""
    position = state.pose[:, :, :2]
    apart_m = np.linalg.norm(position[:, :, None] - position[:, None], axis=3)
    return np.maximum(1.0 - apart_m / NEAR_M, 0.0).sum(axis=2) - 1.0  # each is at 0 m from itself


def flocking_reward(state: ArenaState) -> FloatArray:
    """Aligned with the others, ahead, near the centre of all, not crowded: (arenas, robots)."""
    position, heading = state.pose[:, :, :2], state.pose[:, :, 2]
    unit = np.stack([np.cos(heading), np.sin(heading)], axis=2)
    others = (unit.sum(axis=1, keepdims=True) - unit) / (unit.shape[1] - 1)
    ahead = state.command[:, :, 0] / SPEED_MPS
    from_centre_m = np.linalg.norm(position - position.mean(axis=1, keepdims=True), axis=2)
    away = np.clip(from_centre_m - 0.5, 0.0, 1.5)
    return (unit * others).sum(axis=2) + 0.5 * ahead - 2.0 * away - crowding(state)


def search_reward(state: ArenaState) -> FloatArray:
    """Nearer to the light than before, or at it; ahead, not crowded: (arenas, robots)."""
    now_m, before_m = (np.linalg.norm(at[:, :, :2] - state.light_m, axis=2) for at in (state.pose, state.pose_before))
    nearer = (before_m - now_m) / (SPEED_MPS * TICK_S)
    ahead = state.command[:, :, 0] / SPEED_MPS
    return nearer + (now_m < AT_LIGHT_M) + 0.2 * ahead - 0.5 * crowding(state)


@dataclass(frozen=True)
class Task:
    """What a policy learns."""

    scenario: str
    reward: Callable[[ArenaState], FloatArray]
    discount: float
    updates: int  # of the network, by default
    options: Mapping[str, Any] = field(default_factory=dict)
    unseen: tuple[str, ...] = ()  # numbers of an observation that the network ignores


COMPASS = ("sin compass.heading_rad", "cos compass.heading_rad")  # else all learn to drive north, whatever they hear
COMMON = {"neighbours": 7, "message": 0, "speed_mps": SPEED_MPS, "turn_radps": 2.0}
TASKS = {
    "flocking": Task("flocking.toml", flocking_reward, 0.97, 160, COMMON, unseen=COMPASS),
    "search": Task(
        "search.toml",
        search_reward,
        0.95,
        80,
        {**COMMON, "sensors": ("proximity", "light"), "shared": ("light",)},
    ),
}


class Scaling(nn.Module):
    """Makes the numbers of observations about as large as one another, by those seen under random actions."""

    mean: torch.Tensor
    scale: torch.Tensor

    def __init__(self, seen: torch.Tensor, names: tuple[str, ...], unseen: tuple[str, ...]) -> None:
        super().__init__()
        spread = seen.std(0)
        scale = torch.where(spread < CONSTANT, 1.0, 1.0 / spread)
        ignored = [name in unseen for name in names]
        self.register_buffer("mean", seen.mean(0))
        self.register_buffer("scale", torch.where(torch.tensor(ignored), 0.0, scale))

    def forward(self, seen: torch.Tensor) -> torch.Tensor:
        return ((seen - self.mean) * self.scale).clamp(-MAX_SCALED, MAX_SCALED)


class ActorCritic(nn.Module):
    """The means of the actions, their standard deviations, and the value of what a robot sees."""

    def __init__(self, scaling: Scaling, numbers: int, actions: int) -> None:
        super().__init__()
        self.actor = nn.Sequential(scaling, *layers(numbers, actions, 0.01))
        self.critic = nn.Sequential(scaling, *layers(numbers, 1, 1.0))
        self.log_std = nn.Parameter(torch.full((actions,), FIRST_STD).log())

    def policy(self, seen: torch.Tensor) -> torch.distributions.Normal:
        return torch.distributions.Normal(self.actor(seen), self.log_std.exp())

    def value(self, seen: torch.Tensor) -> torch.Tensor:
        return self.critic(seen)[..., 0]


def layers(numbers: int, outputs: int, gain: float) -> list[nn.Module]:
    """Two hidden layers; the outputs are near 0 at first if `gain` is small."""
    linear = [nn.Linear(numbers, HIDDEN), nn.Linear(HIDDEN, HIDDEN), nn.Linear(HIDDEN, outputs)]
    for layer, scale in zip(linear, (2.0**0.5, 2.0**0.5, gain), strict=True):
        nn.init.orthogonal_(layer.weight, scale)
        nn.init.zeros_(layer.bias)
    return [linear[0], nn.Tanh(), linear[1], nn.Tanh(), linear[2]]


def train(task: Task, losses: list[float], seed: int, updates: int) -> tuple[nn.Module, PolicyLayout]:
    """The trained network of actions, and the layout of what it sees and sets."""
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    envs = vector_env(
        FOLDER / task.scenario,
        arenas=ARENAS,
        seed=seed * 1_000_000,  # far from those of evaluations
        reward=task.reward,
        randomise={"radio.loss": Choice(losses)},
        overrides=[f"duration_s={EPISODE * TICK_S}"],
        autoreset="disabled",  # all episodes end together, and begin together
        hashes=False,
        **task.options,
    )
    layout = next(iter(envs.layouts.values()))
    numbers, actions, robots = len(layout.observation), len(layout.action), envs.reset()[0].shape[1]
    rows = ARENAS * robots
    random_observations = [
        envs.step(torch.rand(ARENAS, robots, actions).mul(2.0).sub(1.0).numpy())[0] for _ in range(ROLLOUT)
    ]
    scaling = Scaling(
        torch.from_numpy(np.concatenate(random_observations)).flatten(0, 1), layout.observation, task.unseen
    )
    model = ActorCritic(scaling, numbers, actions)
    optimiser = torch.optim.Adam(model.parameters(), lr=LEARNING_RATE, eps=1e-5)
    seen, action = torch.zeros(ROLLOUT + 1, rows, numbers), torch.zeros(ROLLOUT, rows, actions)
    logprob, reward, advantage = (torch.zeros(ROLLOUT, rows) for _ in range(3))
    steps, means = EPISODE, list[float]()
    for update in range(updates):
        optimiser.param_groups[0]["lr"] = LEARNING_RATE * (1.0 - update / updates)
        if steps == EPISODE:
            seen[-1], steps = torch.from_numpy(envs.reset()[0].reshape(rows, numbers)), 0
        seen[0] = seen[-1]
        with torch.no_grad():
            for step in range(ROLLOUT):
                policy = model.policy(seen[step])
                action[step] = policy.sample()
                logprob[step] = policy.log_prob(action[step]).sum(1)
                shaped = action[step].numpy().reshape(ARENAS, robots, actions)
                after, _, _, _, infos = envs.step(shaped)
                seen[step + 1] = torch.from_numpy(after.reshape(rows, numbers))
                reward[step] = torch.from_numpy(infos["robot_reward"].reshape(rows))
            value = model.value(seen)  # an episode that ends is cut off: what would follow has a value, too
            ahead = torch.zeros(rows)
            for step in reversed(range(ROLLOUT)):
                error = reward[step] + task.discount * value[step + 1] - value[step]
                advantage[step] = ahead = error + task.discount * LAMBDA * ahead
        steps += ROLLOUT
        rollout = seen[:-1], action, logprob, advantage, advantage + value[:-1]
        flat = [part.flatten(0, 1) for part in rollout]
        for _ in range(EPOCHS):
            for chosen in torch.randperm(ROLLOUT * rows).chunk(BATCHES):
                optimiser.zero_grad()
                policy_loss(model, *(part[chosen] for part in flat)).backward()
                nn.utils.clip_grad_norm_(model.parameters(), MAX_GRADIENT)
                optimiser.step()
        means.append(float(reward.mean()))
        if (update + 1) % 10 == 0:
            print(f"{update + 1} of {updates} updates, mean reward {np.mean(means[-10:]):.3f}", flush=True)
    return model.actor, layout


def policy_loss(
    model: ActorCritic,
    seen: torch.Tensor,
    action: torch.Tensor,
    logprob: torch.Tensor,
    advantage: torch.Tensor,
    target: torch.Tensor,
) -> torch.Tensor:
    """PPO's: the clipped one of the actions, and the squared error of the values."""
    ratio = (model.policy(seen).log_prob(action).sum(1) - logprob).exp()
    advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    gain = torch.minimum(ratio * advantage, ratio.clamp(1.0 - CLIP, 1.0 + CLIP) * advantage)
    return 0.25 * (model.value(seen) - target).square().mean() - gain.mean()


def exported(actor: nn.Module, numbers: int) -> bytes:
    """The network as an ONNX model for any number of robots."""
    example, rows = torch.zeros(2, numbers), torch.export.Dim("rows")
    shapes = ({0: rows},)
    program = torch.onnx.export(actor.eval(), (example,), dynamic_shapes=shapes, dynamo=True, verbose=False)
    assert program is not None
    model = program.model_proto
    for part in (*model.graph.node, *model.graph.value_info, *model.graph.input, *model.graph.output):
        part.ClearField("metadata_props")  # where torch lies on this machine
    return model.SerializeToString()


def main() -> None:
    parser = argparse.ArgumentParser(description="Train a policy by PPO, and save it as an agent.")
    parser.add_argument("task", choices=TASKS)
    parser.add_argument("--loss", type=float, nargs="+", default=[0.0], help="packet losses to draw from (default: 0)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--updates", type=int, help="of the network, each after 5 s in 64 arenas (default: the task's)")
    parser.add_argument("--out", type=Path, required=True, help="the policy's file, .onnx")
    arguments = parser.parse_args()
    task = TASKS[arguments.task]
    actor, layout = train(task, arguments.loss, arguments.seed, arguments.updates or task.updates)
    save_policy(arguments.out, exported(actor, len(layout.observation)), layout)
    print(f"written: {arguments.out}")


if __name__ == "__main__":
    main()
