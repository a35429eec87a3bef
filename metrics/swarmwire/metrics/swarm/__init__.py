"""Metrics of the swarm: how it is spread, how it moves, whom it touches."""
