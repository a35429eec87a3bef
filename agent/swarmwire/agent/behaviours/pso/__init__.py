"""Particle swarm search: memory and rule in `core.py`, robots and points in `variants.py`."""
