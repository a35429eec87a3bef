"""The article's rule in small: in a corridor it deadlocks, and its smoothed cure does not."""

from pathlib import Path

import polars as pl

from docs.experiments.figures.threshold import BOUNDARY, COUNT, CURE, PARTS, RULE, sample_of
from tests.support.experiments.miniature import miniature

PARTS_HERE = [{"blocked_rad": 4.0, "smooth_s": 0.0}, {"blocked_rad": 1.5708, "smooth_s": 0.3}]


def test_the_rule_deadlocks_in_the_corridor_and_its_cure_does_not(tmp_path: Path) -> None:
    done = miniature("threshold", tmp_path, seeds=2, vary={COUNT: [4], PARTS: PARTS_HERE}, overrides=["duration_s=40"])
    deadlocked, swings = pl.col("deadlocked.mean"), pl.col("reversals.final")
    crowd, pair = done.runs["article-rule"], done.runs["article-pair"].filter(pl.col(BOUNDARY) == "walls")
    assert sample_of(crowd, deadlocked, RULE).value.mean() > 0.3
    for runs in (crowd, pair):
        assert sample_of(runs, deadlocked, RULE).value.mean() > 0.1
        assert sample_of(runs, swings, RULE).value.mean() > 1.0
        assert sample_of(runs, deadlocked, CURE).value.mean() < 0.05
        assert sample_of(runs, swings, CURE).value.max() == 0.0, "the cure never drives backwards"
    assert len(done.figure.axes) == 3
    assert done.told.count("the article's rule") == 1 + 4
