"""Refused input by its file and key, and refused frames by their fault; the wording is free."""

import re
from collections.abc import Generator
from contextlib import contextmanager

import pytest

from swarmwire.comms.base.errors import BadFrame, BadInput


@contextmanager
def refused_input(where: object = None, key: str | None = None, match: str = "") -> Generator[None]:
    """Require a BadInput in one line, of this file or option and of this key; None accepts any."""
    with pytest.raises(BadInput, match=r"^[^\n]*$") as caught:
        yield
    assert where is None or caught.value.where == str(where)
    assert key is None or caught.value.key == key
    assert re.search(match, str(caught.value))


@contextmanager
def refused_frame(fault: str = "malformed", match: str | None = None) -> Generator[None]:
    """Require a BadFrame that is counted under this fault."""
    with pytest.raises(BadFrame, match=match) as caught:
        yield
    assert caught.value.fault == fault
