"""Whether a run folder is intact, and holds what its summary says."""
