"""The scenarios that benchmarks run, as mappings: the whole configuration is here."""

import math
from typing import Any

SPEED_MPS = 0.05
BURGER = "turtlebot3-burger"


def diffusion(
    robots: int,
    duration_s: float,
    *,
    steps: int = 5,
    density_per_m2: float = 1.0,
    neighbours: float = 0.0,
    body: str = "footbot",
    engine: str | None = None,
) -> dict[str, Any]:
    """Robots that diffuse: foot-bots with 24 rays by ARGoS's rule, TurtleBots by their scans.

    With `neighbours` every robot broadcasts in each tick, and so many are in reach of it, far from walls. Without
    `engine` it is the scenario's default.
    """
    side_m = math.sqrt(robots / density_per_m2)
    talking = "benchmarks.agents:TalkingDiffusion" if neighbours else "swarmwire.agent.behaviours:Diffusion"
    scenario: dict[str, Any] = {
        "format": 1,
        "name": "diffusion",
        "seed": 1,
        "duration_s": duration_s,
        "time": {"rate_hz": 10},
        "physics": {"steps": steps} if engine is None else {"engine": engine, "steps": steps},
        "arena": {"size_m": [side_m, side_m], "boundary": "walls"},
        "robots": {
            "bots": {
                "body": body,
                "count": robots,
                "place": {"how": "arena"},
                "agent": "benchmarks.agents:ScanDiffusion" if body == BURGER else talking,
                "params": {"speed_mps": SPEED_MPS},
            }
        },
    }
    if neighbours:
        range_m = math.sqrt(neighbours / (math.pi * density_per_m2))
        scenario["radio"] = {"model": "unit-disk", "range_m": range_m, "bit_rate_bps": 250_000}
    return scenario


def flocking(robots: int, duration_s: float, agent: str = "swarmwire.agent.behaviours:Flocking") -> dict[str, Any]:
    """The demo's flock, of another size, and of another agent."""
    side_m = 8.0 * math.sqrt(robots / 20)
    return {
        "format": 1,
        "name": "flocking",
        "seed": 1,
        "duration_s": duration_s,
        "time": {"rate_hz": 10},
        "physics": {"steps": 5},
        "arena": {"size_m": [side_m, side_m], "boundary": "walls"},
        "robots": {
            "flock": {
                "body": "epuck",
                "count": robots,
                "place": {"how": "disc", "radius_m": 0.3 * side_m},
                "agent": agent,
            }
        },
        "radio": {
            "model": "unit-disk",
            "range_m": 2.0,
            "loss": 0.3,
            "latency_s": 0.1,
            "jitter_s": 0.02,
            "measures": {"range": {"noise_m": 0.02}, "bearing": {"noise_rad": 0.05}},
        },
    }


def learning(robots: int) -> dict[str, Any]:
    """E-pucks among five cylinders in an arena of 2 x 2 m, as VMAS's flocking has its agents, with a radio."""
    return {
        "format": 1,
        "name": "learning",
        "duration_s": 1e6,
        "time": {"rate_hz": 10},
        "physics": {"steps": 5},
        "arena": {
            "size_m": [2.0, 2.0],
            "boundary": "walls",
            "obstacles": [{"shape": "cylinder", "radius_m": 0.1, "count": 5, "place": "random"}],
        },
        "robots": {"flock": {"body": "epuck", "count": robots, "agent": "swarmwire.agent.behaviours:Flocking"}},
        "radio": {"model": "unit-disk", "range_m": 1.0, "measures": {"range": {}, "bearing": {}}},
    }
