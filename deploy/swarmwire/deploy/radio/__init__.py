"""Radios without a run: probed, fitted to logs, replayed from measurements."""
