"""VMAS's flocking with random actions, in an environment that has VMAS and PyTorch: prints robot-steps a second.

`python vmas_steps.py ARENAS ROBOTS SECONDS`. One thread, on the processor, without gradients.
"""

# pyright: basic, reportMissingImports=false

import json
import sys
import time

import torch
import vmas


def main(arenas: int, robots: int, seconds: float) -> None:
    torch.set_num_threads(1)
    env = vmas.make_env("flocking", num_envs=arenas, device="cpu", continuous_actions=True, seed=1, n_agents=robots)
    env.reset()
    steps = 0
    with torch.no_grad():
        actions = [[env.get_random_action(agent) for agent in env.agents] for _ in range(10)]
        for action in actions:
            env.step(action)
        started = time.monotonic()  # noqa: TID251 - swarmwire's clock is not here
        while (taken := time.monotonic() - started) < seconds:  # noqa: TID251
            env.step(actions[steps % len(actions)])
            steps += 1
    print(json.dumps(steps * arenas * robots / taken))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))
