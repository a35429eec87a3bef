"""Crews behind the network: who plays which robots, in lockstep or in real time."""
