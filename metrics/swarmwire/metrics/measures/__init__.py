"""Metrics: what is measured of a run, by name, and the conditions that stop it."""
