"""Logs of real robots, read, and made into what metrics measure."""
