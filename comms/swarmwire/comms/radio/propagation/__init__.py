"""What weakens a signal on its way."""
