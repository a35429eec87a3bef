"""Radios of an agent on a robot: the robots' own network, or the air of a world nearby."""
