"""What the exit codes of `swarmwire-agent` mean."""

ENDED = 0
FAILED = 1  # an agent's error, no driver, the guard is gone
BAD_INPUT = 2
INTERRUPTED = 130  # Ctrl-C
