"""Runs in real time, on a clock that a test moves: agents are paced, and what cannot be is refused."""

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import run, wiring
from tests.support.clocks import MS, FakeClock, GoingClock
from tests.support.deploy.commands import LOSSY, called


@pytest.fixture
def _moved(monkeypatch):
    monkeypatch.setattr(wiring, "WallClock", FakeClock)


@pytest.mark.usefixtures("_moved")
def test_agents_in_this_process_are_paced_and_do_the_same():
    short = ["duration_s=2"]
    result = run(LOSSY, overrides=short, realtime=10)
    assert (result.mode, result.wall_time_s) == ("realtime", 0.2)
    assert result.realtime is not None
    assert (result.realtime.factor, result.realtime.missed_ticks) == (10, 0)
    assert result.trajectory_sha256 == run(LOSSY, overrides=short).trajectory_sha256


def test_a_machine_that_cannot_keep_up_says_so_at_once_and_in_the_summary(monkeypatch, capfd):
    monkeypatch.setattr(wiring, "WallClock", lambda: GoingClock(MS))
    result = run(LOSSY, overrides=["duration_s=2"], realtime=1e6)
    assert result.realtime is not None
    assert result.realtime.missed_ticks == 20
    assert result.realtime.worst_lag_s > 0
    assert "does not keep up with 1e+06 x real time" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "key", "expected"),
    [
        *(({"realtime": factor}, "--realtime", "a factor above 0") for factor in (0, -1, float("nan"), "fast")),
        ({"realtime": 1, "overrides": ["run.watchdog_s=0"]}, "run.watchdog_s", "a number above 0"),
        ({"subtick": 0.001}, "--subtick", "--realtime with it"),
        ({"subtick": 0.0009, "realtime": 1}, "--subtick", "0.001 s to a tick's 0.1 s"),
        ({"subtick": float("nan"), "realtime": 1}, "--subtick", "0.001 s"),
        ({"subtick": 0.06, "realtime": 2}, "--subtick", "to a tick's 0.05 s"),
    ],
)
def test_what_cannot_be_is_refused(arguments, key, expected):
    with pytest.raises(BadInput, match=expected) as refused:
        run(LOSSY, **arguments)
    assert key in (refused.value.where, refused.value.key)


def test_without_a_radio_there_is_nothing_between_ticks(tmp_path):
    bare = LOSSY.read_text().partition("[radio]")[0].replace("behaviours:Flocking", "behaviours:Diffusion")
    (tmp_path / "bare.toml").write_text(bare.replace("params = { separation_m = 0.8 }", ""))
    with pytest.raises(BadInput, match="a scenario with a radio"):
        run(tmp_path / "bare.toml", realtime=1, subtick=0.01)


@pytest.mark.usefixtures("_moved")
@pytest.mark.parametrize("arguments", [["--realtime", "1"], ["--realtime=20"]])
def test_the_command_keeps_to_the_factor(arguments, monkeypatch, capsys, tmp_path):
    command = ("run", *arguments, LOSSY, "--set", "duration_s=0.3", "--out", tmp_path / "run")
    code, out, _ = called(monkeypatch, capsys, *command)
    assert code == 0
    assert f"x {20 if '20' in arguments[-1] else 1}; " in out


@pytest.mark.parametrize("arguments", [["--realtime", "0"], ["--realtime", "-2"], ["--realtime=fast"]])
def test_the_command_refuses_a_factor_in_one_line(arguments, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, out, errors = called(monkeypatch, capsys, "run", LOSSY, *arguments)
    assert (code, out, errors.count("\n")) == (2, "", 1)
    assert "--realtime: " in errors
