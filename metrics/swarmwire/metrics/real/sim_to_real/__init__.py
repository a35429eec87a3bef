"""Comparison of emulated runs with logs of real robots by the same metrics."""
