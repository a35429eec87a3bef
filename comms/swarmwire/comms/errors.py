"""Errors divided by whose fault they are.

SwarmwireError
├── BadInput            a scenario, a body, an option: refused at the door (exit code 2)
├── AgentFailed         the user's agent raised (exit code 1)
├── CustomCodeFailed       the user's sensor, actuator or metric raised (exit code 1)
├── RunnerLost          a runner's process or link is gone (exit code 1)
├── RunGone             the run that a view is to follow does not answer (exit code 1); in deploy
├── Refused             what a run that is controlled from elsewhere does not do (exit code 1); in deploy
├── WorkersFailed       workers of a campaign cannot start here; in deploy, as the next five (exit code 1)
├── ClusterFailed       the cluster that was to run a campaign is gone
├── CannotStart         a worker of a cluster cannot start a process that works
├── NotWanted           nobody waits for this task any more: it is not begun
├── StorageFailed       a campaign's folder cannot be written: what is done stays
├── NothingFound        a tuning in which every trial failed
├── HostFailed          a robot's host is out of reach, or cannot do what was asked (exit code 1); in deploy
├── NoGraphics          this machine has nothing to draw with (exit code 1); in metrics
├── RecordFailed        a table of the run folder cannot be written: the run goes on without it
├── NotStopped          a robot that an agent drives did not confirm that it stands still; in agent
├── DriverLost          a real robot does not answer its driver; in agent
├── HostFailed          a computer of the fleet cannot be reached, or cannot do what it was asked to; in deploy
├── Interrupted         somebody asked for the end of the run (exit code 130)
└── BadFrame            a message on the wire breaks the protocol: counted and dropped, never fatal
"""

MAX_LETTERS = 1500  # of a line about bad input


class SwarmwireError(Exception):
    """Every error that swarmwire raises on purpose."""


class BadInput(SwarmwireError):
    """Input that is refused at the door: where it is, which key, what was expected.

    `where` is a file or an option, `key` the path within it ("robots.flock.body"), `expected` one plain sentence.
    """

    def __init__(self, where: str, key: str, expected: str) -> None:
        self.where, self.key, self.expected = where, key, expected
        super().__init__(_one_line(": ".join(part for part in (where, key, expected) if part)))


def _one_line(text: str) -> str:
    """The text as a terminal can show it: keys and values in it may be anything, and of any length."""
    if not text.isprintable():
        text = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    if len(text) <= MAX_LETTERS:
        return text
    half = MAX_LETTERS // 2  # a line begins with the place, and often ends with what was meant
    return f"{text[:half]}…{text[-half:]}"


class AgentFailed(SwarmwireError):
    """An agent raised while it decided: `robots` names whom for, `traceback` is the agent's own."""

    def __init__(self, robots: str, traceback: str) -> None:
        self.robots, self.traceback = robots, traceback
        super().__init__(f"the agent of {robots} failed:\n{traceback}")


class CustomCodeFailed(SwarmwireError):
    """A sensor, actuator or metric of the user's own raised, or told what it should not: `what` names it."""

    def __init__(self, what: str, traceback: str) -> None:
        self.what, self.traceback = what, traceback
        super().__init__(f"{what} failed:\n{traceback}")


class RunnerLost(SwarmwireError):
    """A runner's token is gone or it did not answer in time; `robots` are those that it ran, "" if it never got any."""

    def __init__(self, runner: str, robots: str, reason: str) -> None:
        self.runner, self.robots, self.reason = runner, robots, reason
        what = f"({robots}) was lost" if robots else "got no robots"
        super().__init__(f"runner {runner} {what}: {reason}")


class RecordFailed(SwarmwireError):
    """A table of the run folder cannot be written any more: the disk is full, or refuses."""


class Interrupted(SwarmwireError):
    """Somebody asked for the end of the run while it waited for its runners."""


class BadFrame(SwarmwireError):
    """Bytes that are no frame of this protocol; `fault` is the name under which it is counted."""

    def __init__(self, fault: str, detail: str) -> None:
        self.fault = fault
        super().__init__(f"{fault}: {detail}")
