"""A campaign's folder: what was varied, and what came of each run."""
