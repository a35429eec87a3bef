"""Kernels are kept somewhere also where neither the code's folder nor the user's can be written."""

import atexit
import os
from pathlib import Path

import pytest

from swarmwire.deploy import host
from swarmwire.deploy.host import KERNEL_CACHE, keep_kernels


@pytest.fixture
def at_exit(monkeypatch):
    """What is to be done when the process ends; the place of kernels is as before after the test."""
    registered = []
    monkeypatch.setenv(KERNEL_CACHE, "x")
    monkeypatch.delenv(KERNEL_CACHE)
    monkeypatch.setattr(atexit, "register", lambda act, *given, **_: registered.append((act, given)))
    yield registered
    for act, given in registered:
        act(*given)


def test_where_nothing_can_be_written_they_are_kept_for_this_process(monkeypatch, tmp_path, at_exit):
    file = tmp_path / "file"
    file.touch()
    monkeypatch.setattr(host, "CODE", tmp_path / "nowhere")
    monkeypatch.setenv("XDG_CACHE_HOME", str(file))  # no folder can be made in it
    keep_kernels()
    place = Path(os.environ[KERNEL_CACHE])
    assert place.is_dir()
    keep_kernels()  # as does a process that this one starts
    assert os.environ[KERNEL_CACHE] == str(place)
    assert len(at_exit) == 1
    assert at_exit[0][1] == (str(place),)


def test_a_cache_of_the_user_or_beside_the_code_will_do(monkeypatch, tmp_path, at_exit):
    keep_kernels()
    monkeypatch.setattr(host, "CODE", tmp_path / "nowhere")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    keep_kernels()
    assert KERNEL_CACHE not in os.environ
    assert (tmp_path / "cache" / "numba").is_dir()
