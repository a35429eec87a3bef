"""Robots that others move: the sources of their poses."""
