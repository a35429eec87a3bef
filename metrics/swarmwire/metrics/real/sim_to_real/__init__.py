"""How near a run comes to what real robots did: the same metrics of both, side by side."""
