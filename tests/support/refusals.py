"""Refused input: its kind, file or option, and key, but not its sentence."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from swarmwire.comms.base.errors import BadInput


@contextmanager
def bad_input(key: str, where: object = None, match: str = "") -> Iterator[None]:
    """Expect a BadInput of one line with this key, and, if any, this file or option, and a text that matches."""
    with pytest.raises(BadInput) as caught:
        yield
    assert caught.value.key == key
    assert where is None or caught.value.where == str(where)
    assert "\n" not in str(caught.value)
    assert re.search(match, str(caught.value))
