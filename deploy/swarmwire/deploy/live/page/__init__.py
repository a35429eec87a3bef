"""The page: a live run in a browser on this machine, with controls and fault injection."""
