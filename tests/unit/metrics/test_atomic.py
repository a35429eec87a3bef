"""Files that are there whole or not at all."""

import errno

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.atomic import output_file


def full(to):
    with output_file(to) as aside:
        aside.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_disk_that_is_full_half_way_is_one_line_and_leaves_what_was_there(tmp_path):
    to = tmp_path / "page.html"
    to.write_text("before")
    with pytest.raises(BadInput, match="page.html: .*No space left on device"):
        full(to)
    assert to.read_text() == "before"
    assert list(tmp_path.iterdir()) == [to]


def test_what_else_the_block_raises_is_passed_on(tmp_path):
    with pytest.raises(FileNotFoundError), output_file(tmp_path / "page.html"):
        (tmp_path / "missing").read_text()
    assert list(tmp_path.iterdir()) == []
