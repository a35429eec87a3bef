"""Drivers: the agent's side of a real robot's protocol, found by entry points of the group `swarmwire.drivers`."""
