"""What every part builds on: arrays, clock, keyed draws, errors, configuration, geometry, compiled functions."""
