"""The unit disk: a packet reaches everybody within a fixed range."""
