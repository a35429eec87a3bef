"""What is declared stable does not change unnoticed."""

import pytest

from tests.tools.stable.differences import refuse_unless_as_kept
from tests.tools.stable.kept import STABLE

CHANGED = (
    "What is stable has changed. If whoever was written for the old is still served (something was added), keep the "
    "version; if not, raise it (docs/stability.md says where it stands) and tell users in CHANGELOG.md. "
    "Then renew the list: `python -m tests.tools.stable`."
)


@pytest.mark.parametrize("name", STABLE)
def test_what_is_stable_is_as_it_was(name):
    refuse_unless_as_kept(name, CHANGED)
