"""Campaigns: a scenario at many points of a design, with many seeds each, run in worker processes and kept as a table."""
