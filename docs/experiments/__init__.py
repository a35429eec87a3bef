"""The replicated experiments: run, digested and drawn by `python -m docs.experiments`."""
