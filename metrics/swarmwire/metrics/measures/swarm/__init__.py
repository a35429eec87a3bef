"""Metrics of the swarm: spread, motion and contacts."""
