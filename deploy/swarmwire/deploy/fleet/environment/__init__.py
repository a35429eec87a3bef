"""What a robot's Python needs beside itself: packages at the versions of this machine, for the robot's platform."""
