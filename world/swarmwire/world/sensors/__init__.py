"""Sensors: each has the truth (`sensor.Sensor`), from which `pipeline.Staged` makes readings."""
