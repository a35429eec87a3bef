"""Campaigns: a scenario at many points of a design, with many seeds each, by worker processes, as one table."""
