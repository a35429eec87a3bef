"""Agent backends: the world's side of the agents, in this process or in runners on the network."""
