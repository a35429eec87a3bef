"""Movement with avoidance in small: robots that look meet nobody, and cover more than those that do not."""

from pathlib import Path

import polars as pl

from docs.experiments.figures.movement import BLIND, FAINT, points
from tests.support.experiments.miniature import miniature


def test_robots_that_look_cover_more_and_touch_less(tmp_path: Path) -> None:
    small = {"arena.size_m": [[3.0, 3.0], [4.0, 4.0]], "arena.obstacles.0.radius_m": [0.05, 0.2]}
    done = miniature("movement", tmp_path, seeds=2, vary=small, overrides=["duration_s=60"])
    runs = done.runs["movement"]
    looks = runs.filter(pl.col(FAINT) < BLIND)
    blind = runs.filter(pl.col(FAINT) >= BLIND)
    assert looks["wall_contacts.final"].sum() * 10 < blind["wall_contacts.final"].sum()
    assert looks["collision_rate.final"].sum() < blind["collision_rate.final"].sum()
    assert (looks["coverage.final"].to_numpy() > blind["coverage.final"].to_numpy()).all()
    assert {(side, radius) for side, radius, _, _ in points(runs)} == {(s, r) for s in (3.0, 4.0) for r in (0.05, 0.2)}
    assert len(done.figure.axes) == 3
    assert done.told.count("\n| ") == 2 + 8
