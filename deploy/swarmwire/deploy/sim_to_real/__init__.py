"""Emulated runs and robots' logs, found in folders and brought together."""
