"""Checks for agents: two classes that are the same rule, and rows that do not see one another.

Both feed made-up senses and packets through the same host that runs agents anywhere. All that the body can sense is
drawn anew in every tick, within its range. What robots send is heard one tick later, by each of the others with
probability 0.4; if the agent asks for outcomes, it is told some of each kind. A tenth of the robots is missing in each
tick and starts afresh afterwards.
"""

from swarmwire.agent.testing.checks import assert_equivalent, assert_rows_independent
from swarmwire.agent.testing.trial import Trial

__all__ = ["Trial", "assert_equivalent", "assert_rows_independent"]
