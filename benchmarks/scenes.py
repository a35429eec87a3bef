"""The scenarios that benchmarks run, as mappings: the whole configuration is here."""

import math
from typing import Any

NEIGHBOURS = 9.0
DENSITY_PER_M2 = 1.0
SPEED_MPS = 0.05


def diffusion(robots: int, steps: int, duration_s: float, *, radio: bool) -> dict[str, Any]:
    """Foot-bots with 24 rays and ARGoS's diffusion rule, one per square metre; with radio, a broadcast a tick."""
    side_m = math.sqrt(robots / DENSITY_PER_M2)
    agent = "benchmarks.agents:TalkingDiffusion" if radio else "swarmwire.agent.behaviours:Diffusion"
    scenario: dict[str, Any] = {
        "format": 1,
        "name": "diffusion",
        "seed": 1,
        "duration_s": duration_s,
        "time": {"rate_hz": 10},
        "physics": {"engine": "pymunk", "steps": steps},
        "arena": {"size_m": [side_m, side_m], "boundary": "walls"},
        "robots": {
            "bots": {
                "body": "footbot",
                "count": robots,
                "place": {"how": "arena"},
                "agent": agent,
                "params": {"speed_mps": SPEED_MPS},
            }
        },
    }
    if radio:
        range_m = math.sqrt(NEIGHBOURS / (math.pi * DENSITY_PER_M2))
        scenario["radio"] = {"model": "disk", "range_m": range_m, "bit_rate_bps": 250_000}
    return scenario


def flocking(robots: int, duration_s: float) -> dict[str, Any]:
    """The demo's flock, of another size."""
    side_m = 8.0 * math.sqrt(robots / 20)
    return {
        "format": 1,
        "name": "flocking",
        "seed": 1,
        "duration_s": duration_s,
        "time": {"rate_hz": 10},
        "physics": {"engine": "pymunk", "steps": 5},
        "arena": {"size_m": [side_m, side_m], "boundary": "walls"},
        "robots": {
            "flock": {
                "body": "epuck",
                "count": robots,
                "place": {"how": "disc", "radius_m": 0.3 * side_m},
                "agent": "swarmwire.agent.behaviours:Flocking",
            }
        },
        "radio": {
            "model": "disk",
            "range_m": 2.0,
            "loss": 0.3,
            "latency_s": 0.1,
            "jitter_s": 0.02,
            "gives": {"range": {"noise_m": 0.02}, "bearing": {"noise_rad": 0.05}},
        },
    }
