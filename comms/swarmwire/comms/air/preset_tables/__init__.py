"""The presets by family, a table of them each."""
