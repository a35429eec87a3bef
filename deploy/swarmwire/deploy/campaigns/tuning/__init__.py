"""Tunings: a search for the parameters of a scenario with which a response over many seeds is best."""
