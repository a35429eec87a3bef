"""The physical layer: signals, interference, medium access."""
