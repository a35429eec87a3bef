"""What the machine refuses is told in a line with its cure; what is anybody's mistake keeps its traceback."""

import errno

import numpy as np
import pytest

from swarmwire.deploy import cli
from swarmwire.deploy.refusals import refusal
from tests.support.deploy.commands import called


def test_each_says_what_and_where_and_what_to_do():
    assert refusal(OSError(errno.EMFILE, "Too many open files", "/x")) == (
        "/x: Too many open files (raise the limit: ulimit -n)"
    )
    assert str(refusal(BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"))).startswith(
        "Resource temporarily"
    )
    assert str(refusal(RuntimeError("can't start new thread"))).startswith("no thread can be started (raise the limit")
    assert refusal(MemoryError()) == "no memory is left (fewer robots, seeds or runners need less)"
    with pytest.raises(MemoryError) as told:
        np.empty(2**56)
    assert str(refusal(told.value)).startswith("no memory is left: Unable to allocate")
    assert (
        refusal(RuntimeError("wrong")) is refusal(FileNotFoundError(errno.ENOENT, "x")) is refusal(KeyError()) is None
    )


def test_the_command_line_ends_with_that_line_and_passes_on_what_is_a_mistake(monkeypatch, capsys):
    def raises(error):
        def app(_):
            raise error

        monkeypatch.setattr(cli, "app", app)
        return called(monkeypatch, capsys, "run")

    assert raises(OSError(errno.EMFILE, "Too many open files")) == (
        1,
        "",
        "error: Too many open files (raise the limit: ulimit -n)\n",
    )
    with pytest.raises(RuntimeError, match="a mistake"):
        raises(RuntimeError("a mistake"))
