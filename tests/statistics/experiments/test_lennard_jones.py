"""The experiment on Lennard-Jones flocking in small."""

from tests.support.experiments.miniature import miniature


def test_it_is_drawn_and_told_and_lost_packets_make_robots_dither(tmp_path):
    vary = {"radio.loss": [0.0, 0.9], "radio.latency_s": [0.0, 0.5]}
    small = miniature("lennard-jones", tmp_path, seeds=3, vary=vary, overrides=["duration_s=20"])
    (runs,) = small.runs.values()
    assert len(small.figure.axes) == 4
    assert small.told.count("\n") == 1 + 4
    mean = {
        key: of["oscillation.final"].to_numpy().mean() for key, of in runs.group_by("radio.loss", "radio.latency_s")
    }
    assert mean[0.9, 0.0] > 1.5 * mean[0.0, 0.0]
