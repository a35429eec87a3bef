"""The folder of a run: its files and tables, how they are written, read back and verified."""
