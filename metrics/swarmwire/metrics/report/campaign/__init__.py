"""The report of a campaign: a section a file."""
