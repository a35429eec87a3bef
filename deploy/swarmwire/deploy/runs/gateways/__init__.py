"""Robots of a run that answer as real ones: which ones, at which addresses, and what would drive them."""
