"""Measurements of a radio without a run: coverage and contention."""
