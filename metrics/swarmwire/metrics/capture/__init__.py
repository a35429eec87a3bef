"""Captures of the frames on air, for Wireshark."""
