"""The experiment on minimalist flocking in small: it is swept, digested, drawn and told, and shows its main effects."""

import numpy as np
import polars as pl
import pytest

from tests.support.experiments.miniature import miniature

NAME = "minimalist-flocking"


def test_it_is_drawn_and_told(tmp_path):
    small = miniature(NAME, tmp_path, seeds=2, overrides=["duration_s=1"])
    assert len(small.figure.axes) == 4
    assert small.told.count("**") == 2 * 6
    assert all(f"| equal density | {n} | 2 |" in small.told for n in (5, 10, 15, 20))


def test_five_robots_flock_where_the_thresholds_let_them_and_one_hop_is_never_earlier(tmp_path):
    (runs,) = miniature(
        NAME, tmp_path, seeds=10, overrides=["duration_s=25"], campaigns=["minimalist-thresholds"]
    ).runs.values()
    by_hop, by_cluster = (runs[name].fill_null(np.inf) for name in ("hop_60_s", "cluster_60_s"))
    assert (by_cluster <= by_hop).all()
    assert (runs["hop_60_s"].fill_null(np.inf) <= runs["hop_80_s"].fill_null(np.inf)).all()
    met = runs.group_by("robots.swarm.params.separation_diameters").agg(pl.col("hop_60_s").is_not_null().mean())
    share = dict(met.iter_rows())
    assert share[0.5] > share[1.0] + 0.2


def test_the_limit_censors_what_had_not_come_by_then(tmp_path):
    (runs,) = miniature(
        NAME, tmp_path, seeds=3, overrides=["duration_s=2"], campaigns=["minimalist-small"]
    ).runs.values()
    waiting = runs.filter(pl.col("hop_80_s").is_null())
    assert len(waiting)
    assert waiting["sim_time_s"].to_list() == pytest.approx([2.0] * len(waiting))
