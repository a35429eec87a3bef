"""The agents of a run as the world sees them: in this process, or behind the network."""
