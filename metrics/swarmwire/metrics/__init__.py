"""Metrics, recorded tables, drawings and reports of runs; depends on comms, not on world or agents."""
