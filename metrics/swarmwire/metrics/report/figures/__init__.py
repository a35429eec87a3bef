"""Figures of a report: each from plain numbers to a matplotlib figure of a column's width; no files, no statistics."""
