"""Captures: what was on air, as a file that Wireshark opens."""
