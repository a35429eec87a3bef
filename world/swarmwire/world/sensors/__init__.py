"""Sensors: each computes the truth (`sensor.Sensor`), from which `pipeline.SensorPipeline` makes readings."""
