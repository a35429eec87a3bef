"""Checks for agents: two classes that are the same rule, and rows that do not see one another.

Both feed made-up senses and packets through the same host that runs agents anywhere.
"""

from swarmwire.agent.testing.checks import assert_equivalent, assert_rows_independent
from swarmwire.agent.testing.trial import Trial

__all__ = ["Trial", "assert_equivalent", "assert_rows_independent"]
