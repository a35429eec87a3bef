"""The contract between world and agents, the wire between them, and the air: what both sides may know."""
