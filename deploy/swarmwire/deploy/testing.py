"""The fixture `expect` for pytest, which has it wherever swarmwire is installed.

It checks results as `swarmwire.deploy.expect` does, and adds what was measured to the file of `pytest --junit-xml`.
"""

from typing import TYPE_CHECKING, Protocol

import pytest

if TYPE_CHECKING:  # pytest loads this module also for tests that do not use swarmwire
    from pathlib import Path

    from swarmwire.deploy import Result, Sweep, Verdict

__all__ = ["Expect", "expect"]


class Expect(Protocol):
    """The type of the fixture."""

    def __call__(self, target: "Result | Sweep | Path | str", *expectations: str) -> "list[Verdict]":
        """Assert that a run or a campaign meets expectations; arguments and errors are those of `expect`."""
        ...


@pytest.fixture
def expect(request: pytest.FixtureRequest) -> Expect:
    """Return a function that asserts expectations, such as `expect(run("flock.toml", seeds=10), "order >= 0.9")`."""

    def check(target: "Result | Sweep | Path | str", *expectations: str) -> "list[Verdict]":
        __tracebackhide__ = True
        from swarmwire.deploy.campaigns.expecting import NotMet, verdicts_on

        checked = verdicts_on(target, expectations)
        # The fixture record_property would warn that this is not in the schema of pytest's default format.
        request.node.user_properties += [(each.title, each.measured) for each in checked]
        if not all(each.is_met for each in checked):
            raise NotMet(checked)
        return checked

    return check
