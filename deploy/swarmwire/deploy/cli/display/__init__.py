"""Progress, panels and results of commands in the terminal."""
