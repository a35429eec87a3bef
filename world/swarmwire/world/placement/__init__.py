"""Where things stand at the start of an arena."""
