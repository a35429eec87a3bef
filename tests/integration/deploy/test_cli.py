"""The command line as a whole."""

import subprocess
import sys
from importlib.metadata import version

from tests.support.deploy.commands import called

HEAVY = ("numba", "pydantic", "pymunk", "scipy", "polars", "zenoh", "matplotlib", "rerun")


def test_help_waits_for_no_heavy_library():
    code = f"import sys, swarmwire.deploy.cli.app; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.strip() == "[]"


def test_paragraphs_of_help_are_as_wide_as_the_terminal(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    _, out, _ = called(monkeypatch, capsys, "robots", "deploy", "--help")
    assert "as it was, and others go on; to do it again does only what is missing. Robots" in out
    assert "  swarmwire robots deploy fleet.toml --group red --restart" in out


def test_it_says_its_version(monkeypatch, capsys):
    code, out, errors = called(monkeypatch, capsys, "--version")
    assert (code, out, errors) == (0, f"swarmwire {version('swarmwire-deploy')}\n", "")
