"""The discs engine: robots as discs, all arenas and steps of a tick in one compiled call."""
