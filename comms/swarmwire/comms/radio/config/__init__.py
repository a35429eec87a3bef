"""What a scenario says of a radio: tables, checks, presets. No compiled code."""
