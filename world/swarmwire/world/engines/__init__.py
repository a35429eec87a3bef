"""What moves bodies: one small interface, an engine a file."""
