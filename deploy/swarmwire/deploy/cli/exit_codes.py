"""What the command line's exit codes mean."""

FAILED = 1  # the run failed: an agent's error, a runner lost
DIFFERENT = 1  # a repetition came out differently, or there is nothing to compare it with
BAD_INPUT = 2
HUNG_UP = 129  # the terminal is gone, with a summary
INTERRUPTED = 130  # Ctrl-C, with a summary
