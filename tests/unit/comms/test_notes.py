"""A state that an agent names is a short text."""

import pytest

from swarmwire.comms.notes import checked_state


@pytest.mark.parametrize("state", ["a", "ä" * 64])
def test_a_short_text_is_a_state(state):
    assert checked_state(state) == state


@pytest.mark.parametrize("state", ["", "a" * 65, None, 1, b"a"])
def test_anything_else_is_refused_as_it_was_called(state):
    with pytest.raises(ValueError, match=r"^note\(state=…\): expected a text of 1 to 64 characters"):
        checked_state(state)
