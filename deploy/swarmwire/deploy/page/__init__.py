"""The page: a run that goes on, in a browser on this machine, with what controls, breaks and mends it beside it."""
