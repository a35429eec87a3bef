"""Runs in rerun's viewer: recorded, live, or as a picture that it draws."""
