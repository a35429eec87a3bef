"""Foundations of every part: arrays, clock, keyed draws, errors, configuration, geometry, compiled functions."""
