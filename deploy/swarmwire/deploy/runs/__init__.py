"""One run: its options, its parts, its phases and its records."""
