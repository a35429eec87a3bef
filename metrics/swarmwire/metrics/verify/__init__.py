"""Whether a run folder is whole, and holds what its summary says."""
