"""The world: scenario, placement, physics, sensors and the loop. It owns the truth and gives robots their sensors."""
