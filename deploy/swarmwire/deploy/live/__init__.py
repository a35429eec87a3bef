"""Looking at a run while it goes on: what it publishes for observers, and the process that shows it."""
