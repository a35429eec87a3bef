"""An agent on a robot: driver, radio, host, watchdog and log in one process, paced by the wall clock."""
