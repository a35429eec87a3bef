"""The contract between world and agents, the wire between them, and the medium: what both sides may know."""
