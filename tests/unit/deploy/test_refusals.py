"""What the machine refuses is told in a line with its cure; what is anybody's mistake keeps its traceback."""

import errno

import numpy as np
import pytest

from swarmwire.deploy.cli import app as cli
from swarmwire.deploy.host import refusal
from tests.support.deploy.commands import called


def test_each_says_what_and_where_and_what_to_do():
    files = str(refusal(OSError(errno.EMFILE, "Too many open files", "/x")))
    assert files.startswith("/x: Too many open files")
    assert "ulimit -n" in files
    assert "temporarily unavailable" in str(refusal(BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")))
    assert "raise the limit" in str(refusal(RuntimeError("can't start new thread")))
    assert "fewer robots" in str(refusal(MemoryError()))
    with pytest.raises(MemoryError) as told:
        np.empty(2**56)
    assert "Unable to allocate" in str(refusal(told.value))
    assert (
        refusal(RuntimeError("wrong")) is refusal(FileNotFoundError(errno.ENOENT, "x")) is refusal(KeyError()) is None
    )


def test_the_command_line_ends_with_that_line_and_passes_on_what_is_a_mistake(monkeypatch, capsys):
    def raises(error):
        def app(_):
            raise error

        monkeypatch.setattr(cli, "app", app)
        return called(monkeypatch, capsys, "run")

    code, out, errors = raises(OSError(errno.EMFILE, "Too many open files"))
    assert (code, out, errors.count("\n")) == (1, "", 1)
    assert errors.startswith("error: Too many open files")
    with pytest.raises(RuntimeError, match="a mistake"):
        raises(RuntimeError("a mistake"))
