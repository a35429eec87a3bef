"""The tables of a scenario's `[radio]`, their checks, and the presets. No compiled code."""
