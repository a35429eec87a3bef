"""Logs of real robots: read, compared with emulated runs, and fitted to radios."""
