"""Errors, grouped by their cause.

SwarmwireError
├── BadInput            a scenario, a body, an option is refused (exit code 2)
├── AgentFailed         the user's agent raised (exit code 1)
├── CustomCodeFailed    a custom sensor, actuator or metric raised (exit code 1)
├── RunnerLost          a runner's process or link is gone (exit code 1)
├── RecordFailed        the run folder, or a table in it, cannot be written: the run continues without it (exit code 1)
├── Interrupted         the run was interrupted while it waited for its runners (exit code 130)
├── BadFrame            a message on the wire breaks the protocol: counted and dropped, never fatal
├── in agent
│   ├── NotStopped      a robot that an agent drives did not confirm that it stands still
│   └── DriverLost      a real robot does not answer its driver
├── in metrics
│   └── NoGraphics      this machine has no graphics to draw with (exit code 1)
└── in deploy (exit code 1)
    ├── RunGone         the run that a view follows does not answer
    ├── Refused         a running simulation refuses a control request
    ├── WorkersFailed   workers of a campaign cannot start on this machine
    ├── ClusterFailed   the cluster that ran a campaign is gone
    ├── CannotStart     a worker of a cluster cannot start a working process
    ├── NotWanted       no process waits for this task any more: it is not begun
    ├── StorageFailed   a campaign's folder cannot be written: finished trials stay
    ├── NothingFound    every trial of a tuning failed
    ├── NotMet          a run or a campaign does not meet an expectation; also an AssertionError
    └── HostFailed      a computer of the fleet cannot be reached, or a request to it failed
"""

from typing import TYPE_CHECKING

from swarmwire.comms.base.printable import printable

if TYPE_CHECKING:
    from typing import Any  # not at run time: the module's public names are its errors

MAX_LINE_CHARACTERS = 1500  # longest message about bad input


class SwarmwireError(Exception):
    """Base class of all errors that swarmwire raises on purpose."""

    def __reduce__(self) -> tuple[object, ...]:
        """Copy the message and the attributes without the constructor, whose arguments differ."""
        return _error, (type(self), self.args), self.__dict__


def _error(kind: type[SwarmwireError], args: tuple[object, ...]) -> SwarmwireError:
    return kind.__new__(kind, *args)


class BadInput(SwarmwireError):
    """Refused input: `where` is a file or an option, `key` the path within it, such as "robots.flock.body".

    `expected` is one plain sentence about the values that are accepted.
    """

    def __init__(self, where: str, key: str, expected: str) -> None:
        self.where, self.key, self.expected = where, key, expected
        super().__init__(_one_line(": ".join(part for part in (where, key, expected) if part)))


def _one_line(text: str) -> str:
    """Return the text as one printable line of limited length; keys and values in it may contain any character."""
    text = printable(text)
    if len(text) <= MAX_LINE_CHARACTERS:
        return text
    half = MAX_LINE_CHARACTERS // 2  # a line begins with the file and key, and often ends with the suggestion
    return f"{text[:half]}…{text[-half:]}"


class AgentFailed(SwarmwireError):
    """An agent raised in its step: `robots` are the robots of that step, `traceback` is that of the agent's code."""

    def __init__(self, robots: str, traceback: str) -> None:
        self.robots, self.traceback = robots, traceback
        super().__init__(f"the agent of {robots} failed:\n{traceback}")


class CustomCodeFailed(SwarmwireError):
    """A custom sensor, actuator or metric raised, or returned an invalid value; `name` is the name of it."""

    def __init__(self, name: str, traceback: str) -> None:
        self.name, self.traceback = name, traceback
        super().__init__(f"{name} failed:\n{traceback}")


class RunnerLost(SwarmwireError):
    """A runner's token is gone or it did not answer in time; `robots` is a text of its robots, "" if it had none."""

    def __init__(self, runner: str, robots: str, reason: str) -> None:
        self.runner, self.robots, self.reason = runner, robots, reason
        event = f"({robots}) was lost" if robots else "got no robots"
        super().__init__(f"runner {runner} {event}: {reason}")


class RecordFailed(SwarmwireError):
    """The run folder, or a table in it, cannot be written, for example because the disk is full.

    `result` is the `swarmwire.deploy.Result` of a finished run without a summary in its folder; else None.
    """

    def __init__(self, text: str, result: "Any" = None) -> None:
        self.result = result
        super().__init__(text)


class Interrupted(SwarmwireError):
    """The run was interrupted while it waited for its runners."""


class BadFrame(SwarmwireError):
    """Bytes that are no frame of this protocol; `fault` is the name of the counter that counts them."""

    def __init__(self, fault: str, detail: str) -> None:
        self.fault = fault
        super().__init__(f"{fault}: {detail}")
