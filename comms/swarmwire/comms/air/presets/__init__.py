"""Kinds of radio that a scenario may name."""
