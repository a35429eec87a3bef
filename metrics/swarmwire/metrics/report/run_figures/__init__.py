"""Figures of a single run: from arrays to matplotlib figures, one a file."""
