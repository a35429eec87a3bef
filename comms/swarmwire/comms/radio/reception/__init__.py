"""Whether a receiver gets a frame right."""
