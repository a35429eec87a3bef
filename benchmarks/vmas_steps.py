"""Prints robot-steps a second of processor time of VMAS's flocking with random actions.

`python vmas_steps.py ARENAS ROBOTS SECONDS`, with a Python that has VMAS and PyTorch. One thread, without gradients.
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
        started = time.process_time()
        while (elapsed_s := time.process_time() - started) < seconds:
            env.step(actions[steps % len(actions)])
            steps += 1
    print(json.dumps(steps * arenas * robots / elapsed_s))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))
