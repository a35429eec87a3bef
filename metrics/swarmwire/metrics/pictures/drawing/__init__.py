"""Pictures and films by matplotlib, in memory: no screen, no graphics driver, no state of pyplot."""
