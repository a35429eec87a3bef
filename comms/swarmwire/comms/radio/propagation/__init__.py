"""Propagation: path loss, shadowing, fading and obstruction."""
