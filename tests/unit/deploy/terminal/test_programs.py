"""Programs as people can type them."""

import sys

import pytest

from swarmwire.deploy.terminal.programs import program


@pytest.mark.parametrize(
    ("called", "name", "typed"),
    [
        ("here/bin/swarmwire", "swarmwire-agent", "bin/swarmwire-agent"),
        ("bin/swarmwire", "swarmwire-agent", "{root}/bin/swarmwire-agent"),
        ("here/bin/swarmwire", "other", "other"),
        ("here/mine.py", "swarmwire-agent", "swarmwire-agent"),
    ],
    ids=["below the folder", "elsewhere", "not beside it", "from a program of others"],
)
def test_what_is_printed_can_be_typed(tmp_path, monkeypatch, called, name, typed):
    for folder in ("bin", "here/bin"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "swarmwire-agent").touch()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setattr(sys, "argv", [str(tmp_path / called)])
    assert str(program(name)) == typed.format(root=tmp_path)
