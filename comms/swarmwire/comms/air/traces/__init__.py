"""Traces: links as they were measured, replayed."""
