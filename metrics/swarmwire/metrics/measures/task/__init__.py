"""Metrics of a task: how far the swarm has come with what it is there for."""
