"""Runs in rerun's viewer: recorded, live, or as pictures."""
