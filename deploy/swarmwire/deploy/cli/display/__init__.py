"""What commands show in the terminal: progress, panels and results."""
