"""Pages of the behaviours: what stands on each is made by `python -m docs.behaviours`."""
