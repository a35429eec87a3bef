"""Particle swarm search: what sets robots apart from point particles, and noisy photocells."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from docs.experiments.figures._pso import Kind, at, digested, ladder, steps_table, variants_table
from swarmwire.metrics.pictures.drawing.canvas import ACCENT, CURVE, SOFT, TEXT_PT, plain_axes
from swarmwire.metrics.pictures.report.page import blank_figure

__all__ = ["CAMPAIGNS", "COLUMNS", "PAGE", "digested", "draw", "numbers"]

PAGE = "pso"
CAMPAIGNS = ("pso-why", "pso-why-model", "pso-noise")
COLUMNS = ("find_time_s",)
PARAMS = "robots.particles.params."
AGENT, BODY, SPEED = "robots.particles.agent", "robots.particles.body", f"{PARAMS}speed_mps"
KEEPS, AGAIN = (f"{PARAMS}{name}" for name in ("keeps_received", "again_m"))
KINDS = Kind("", "robots", CURVE), Kind("-model", "particles", ACCENT)
ROBOTS = (  # what is said, and whether places come by camera, bodies are in the way, and obstacles
    ("e-pucks", False, True, True),
    ("e-pucks, places by camera", True, True, True),
    ("e-pucks, no bodies in the way", False, False, True),
    ("e-pucks, no obstacles", False, True, False),
    ("e-pucks, none of the three", True, False, False),
)
PARTICLES = (  # what is said, whether there are obstacles, and speed in m/s
    ("particles at half speed", False, 0.05),
    ("particles at three quarters", False, 0.075),
    ("particles among obstacles", True, 0.1),
    ("particles", False, 0.1),
)


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """One panel: what was taken away from robots."""
    figure = blank_figure(5.0, 2.6)
    axes = plain_axes(figure, (0.32, 0.17, 0.65, 0.72), "radio to 2 m: mean time to half there (at most 300 s)")
    axes.set_xlabel("s", fontsize=TEXT_PT, color=SOFT)
    ladder(axes, [(label, step_runs, KINDS["e-puck" not in label].color) for label, step_runs in steps(runs)])
    return figure


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """Tables: what sets robots apart, and noise."""
    robot_steps = steps(runs)
    noisy = runs["pso-noise"].with_columns(pl.when(pl.col(BODY) == "epuck").then(0.05).otherwise(0.3).alias("noise"))
    noise = {"noise": "noise of a photocell", KEEPS: "keeps what it received", AGAIN: "measured again within, m"}
    return "\n\n".join(
        (
            f"Robots and particles with a radio to 2 m:\n\n{steps_table(robot_steps, robot_steps[0][1])}",
            f"Noisy photocells:\n\n{variants_table(noisy, noise)}",
        )
    )


def steps(runs: Mapping[str, pl.DataFrame]) -> list[tuple[str, pl.DataFrame]]:
    """From the robots as they are to the model: what was taken away, and its runs."""
    placed = pl.col(AGENT).str.ends_with("Positioned")
    bodies = ~pl.col(BODY).str.contains("ghost")
    robots = [
        (label, runs["pso-why"].filter((placed == camera) & (bodies == solid) & (pl.col("obstacles") == obstacles)))
        for label, camera, solid, obstacles in ROBOTS
    ]
    particles = [
        (label, at(runs["pso-why-model"], **{"obstacles": obstacles, SPEED: speed_mps}))
        for label, obstacles, speed_mps in PARTICLES
    ]
    return robots + particles
