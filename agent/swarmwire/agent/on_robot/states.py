"""States of a robot, which its status reports under "state"; light to import, for the commands that read a status."""

RUNNING = "running"
LOST = "driver lost"  # the robot does not answer
STOP_REQUESTED = "estop"  # after an emergency stop
