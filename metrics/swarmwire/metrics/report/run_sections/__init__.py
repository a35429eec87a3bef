"""What the report of a single run holds, a section a file."""
