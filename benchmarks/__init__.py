"""Benchmarks: `make bench`, or `make bench ONLY=name`; one JSON object a line."""
