"""Sine and cosine of the array engine agree with numpy's."""

import numpy as np

from swarmwire.world.engines.discs.step import sine_cosine


def test_sine_and_cosine_are_numpy_s_within_rounding() -> None:
    rng = np.random.default_rng(1)
    eighths = np.arange(-64, 65) * np.pi / 4
    for angles in (rng.uniform(-4.0, 4.0, 3000), rng.uniform(-1e4, 1e4, 3000), eighths, rng.normal(0.0, 1e-9, 100)):
        both = np.array([sine_cosine(angle) for angle in angles])
        assert np.abs(both - np.stack([np.sin(angles), np.cos(angles)], axis=1)).max() < 3e-16
    assert np.abs(np.array(sine_cosine(1e6)) - [np.sin(1e6), np.cos(1e6)]).max() < 1e-13
