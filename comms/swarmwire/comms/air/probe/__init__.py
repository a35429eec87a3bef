"""What a radio does in an arena, without a run."""
