"""What users see when something is refused: whole lines, an example of each form.

Other tests assert the file, the key and the kind of an error, so that a sentence may become better in one place.
"""

from pathlib import Path

import pytest

from swarmwire.deploy.certificates.folder import begin_authority
from tests.support.deploy.certificates import DatedFakeClock
from tests.support.deploy.commands import LOSSY, called

DO = "blackout, fail, gain, impulse, jammer, kill, partition, ramp, revive"
PRESETS = (
    "ideal, unit-disk, bernoulli, gilbert, argos-rab, infrared-epuck, ieee802154, wifi-b-1M, wifi-a-6M, ble-1M, "
    "gz-rfcomms, subt, kilobot, acoustic"
)
KINDS = (
    "bodies, drives, body-keys, sensors, behaviours, fields, events, metrics, radio, presets, stages, fates, engines, "
    "drivers, gateways, keys"
)
OTHER_PRESETS = PRESETS.replace("wifi-b-1M, ", "")
PARAMETERS = "speed_mps, separation_m, cohesion, alignment, avoidance, forward, turn_gain_per_s"
OF_SETTINGS = [
    ("seed", "expected path=value, such as robots.flock.count=30"),
    ("name.x=1", "name.x: name holds no keys"),
    ("duration_s=inf", "duration_s: expected a number above 0 and at most 1000000000 (s), got inf"),
    ("radio={}", "radio.range_m: is missing; expected a number above 0 (m), as the model unit disk has one"),
    (
        "radio.preset='wifi'",
        f"radio.preset: expected one of wifi-b-1M (did you mean this?), {OTHER_PRESETS}, got 'wifi'",
    ),
    (
        "robots.flock.cuont=3",
        "robots.flock.cuont: unknown key; expected one of count (did you mean this?), body, body_overrides, agent, "
        "act_every_ticks, params, radio, place",
    ),
    ("events=[{at_s=1}]", f"events.0.do: is missing; expected one of {DO}"),
    (
        "events=[{at_s=1, do='kill', robots={group='flok'}}]",
        "events.0.robots.group: expected one of flock (did you mean this?); got 'flok'",
    ),
    (
        "arena.obstacles=[{shape='polygon', at=[0, 0], points=[[0, 0], [1, 1], [1, 0], [0, 1]]}]",
        "arena.obstacles.0.points: expected the corners of a convex polygon in order; "
        "(0, 0) lies on or beyond the side from (0, 1) to (1, 0)",
    ),
]
OF_FILES = [  # an override by which something else in the file becomes wrong
    (
        "robots.flock.agent='swarmwire.agent.behaviours:Dance'",
        "robots.flock.agent: swarmwire.agent.behaviours holds no such name: 'Dance'",
    ),
    (
        "robots.flock.params.separation=1",
        f"robots.flock.params.separation: unknown parameter of Flocking; expected one of separation_m "
        f"(did you mean this?), {PARAMETERS.replace('separation_m, ', '')}",
    ),
    (
        "radio.measures={}",
        "robots.flock.agent: Flocking needs 'radio.range', which the radio does not measure: "
        "[radio.measures] has nothing",
    ),
]
OF_COMMANDS = [
    ("run absent.toml", "absent.toml: expected a readable file: No such file or directory"),
    (f"run {LOSSY} --runners all", '--runners: expected "none", "per-robot" or 1 to 20 (the robots), got \'all\''),
    ("list nothing", f"nothing: expected one of {KINDS}; swarmwire describe tells about a single thing"),
    ("describe flokking", "flokking: nothing has this name; nearest: Flocking (swarmwire list names all)"),
    ("export absent --to film.gif", "absent: expected a run folder: there is none"),
    ("certs issue absent a", "absent: expected a CA's folder: swarmwire certs init absent"),
    (
        "certs issue ca a/b",
        "NAME: expected 1 to 63 letters (a to z), digits, - and _ that start with a letter and do not end in -, "
        "got 'a/b'",
    ),
    (
        "radio probe unit-disk",
        "--contention: expected nodes (2 or more), bytes and an interval of 0.001 to 1 s, such as 20,20,0.1",
    ),
    ("ctl pause", "expected a run that goes on: this machine has none of yours"),
]


@pytest.fixture
def said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """What a command prints that fails with exit code 2, in a folder with a CA."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    begin_authority(tmp_path / "ca", DatedFakeClock("2026-06-01T12:00:00Z"))

    def call(*words: str) -> str:
        code, out, errors = called(monkeypatch, capsys, *words)
        assert (code, out) == (2, "")
        return errors

    return call


@pytest.mark.parametrize(("setting", "line"), OF_SETTINGS)
def test_a_setting_is_refused_with_its_option_its_key_and_what_was_expected(said, setting, line):
    assert said("check", str(LOSSY), "--set", setting) == f"error: --set {setting}: {line}\n"


@pytest.mark.parametrize(("setting", "line"), OF_FILES)
def test_what_does_not_fit_a_setting_is_refused_with_its_file(said, setting, line):
    assert said("check", str(LOSSY), "--set", setting) == f"error: {LOSSY}: {line}\n"


@pytest.mark.parametrize(("words", "line"), OF_COMMANDS)
def test_a_command_is_refused_with_what_to_type_instead(said, words, line):
    assert said(*words.split()) == f"error: {line}\n"
