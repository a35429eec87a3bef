"""Tunings: a search for the parameters of a scenario with which an outcome over many seeds is best."""
