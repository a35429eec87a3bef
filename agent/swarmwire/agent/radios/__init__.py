"""Radios of an agent on a robot: the robots' own network, or the medium of a world nearby."""
