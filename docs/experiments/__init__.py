"""The experiments of the founding papers: run, digested and drawn by `python -m docs.experiments`."""
