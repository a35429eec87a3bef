"""What a run leaves behind: a summary that adds up, the same numbers from Python, and every metric that there is."""

import json

from swarmwire.deploy import run
from swarmwire.metrics.measures.registry import METRICS, standard_names
from tests.support.deploy.runs import LOSSY, called

MEASURED = {"wall_time_s", "start_time_s", "realtime_factor"}
REQUIRED = MEASURED | {
    "scenario", "seed", "robots", "runners", "mode", "ticks", "sim_time_s", "trajectory_sha256", "cpu", "versions",
    "radio", "metrics",
}  # fmt: skip


def test_summary_of_the_command_equals_the_result_in_python(tmp_path, monkeypatch, capsys):
    arguments = ("run", LOSSY, "--set", "duration_s=4", "--out", tmp_path / "run", "--quiet")
    assert called(monkeypatch, capsys, *arguments) == (0, "", "")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary.keys() >= REQUIRED
    assert set(summary["metrics"]) >= {"order", "largest_component", "components", "collisions"}
    result = json.loads(json.dumps(run(LOSSY, overrides=["duration_s=4"]).summary()))
    for key in (*MEASURED, "files", "record"):  # the last two: only with a run folder
        del summary[key]
        result.pop(key, None)
    assert summary == result
    assert (tmp_path / "run" / "run.rrd").stat().st_size > 10_000


def test_several_arenas_have_lists(tmp_path):
    result = run(LOSSY, seeds=[3, 5], overrides=["duration_s=1"], out=tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["seed"] == [3, 5]
    assert [len(summary[key]) for key in ("trajectory_sha256", "radio", "metrics")] == [2, 2, 2]
    assert [arena.seed for arena in result.arenas] == [3, 5]


def test_without_a_radio_there_is_no_radio_part(tmp_path):
    scenario = tmp_path / "mute.toml"
    text = LOSSY.read_text()
    scenario.write_text(text[: text.index("[radio]")])
    diffusion = ["robots.flock.agent=swarmwire.agent.behaviours:Diffusion", "robots.flock.params={}", "duration_s=1"]
    result = run(scenario, overrides=diffusion)
    assert result.radio is None
    assert result.metrics["order"].mean is not None
    assert result.metrics["components"].mean is None


def test_schema_is_json_schema_with_units_and_bounds(monkeypatch, capsys):
    schema = json.loads(called(monkeypatch, capsys, "schema")[1])
    assert schema["properties"]["duration_s"]["exclusiveMinimum"] == 0
    assert {"time", "physics", "arena", "robots", "radio", "run"} <= set(schema["properties"])


STONES = """
format = 1
name = "stones"
duration_s = 0.1
arena = { size_m = [3, 3] }
[robots]
placed = { body = "kilobot", count = 2, agent = "AGENT", body_overrides.sensors.positioning = {} }
heavy = { body = "kilobot", count = 2, agent = "AGENT", body_overrides.mass_kg = 1.0 }
gps = { body = "epuck-gps", count = 1, agent = "AGENT" }
"""


def test_groups_of_one_body_do_not_hide_global_senses_of_others(tmp_path):
    (tmp_path / "stone.py").write_text(
        "from swarmwire.agent import Agent\nclass Stone(Agent):\n    def step(self, _): ..."
    )
    (tmp_path / "stones.toml").write_text(STONES.replace("AGENT", "stone.py:Stone"))
    result = run(tmp_path / "stones.toml")
    assert result.global_sensors == {"kilobot of placed": ["positioning"], "epuck-gps": ["compass", "positioning"]}


NAMES = sorted(METRICS.keys() - set(standard_names()))
SETTING = [
    "duration_s=6",
    f"metrics={json.dumps(NAMES)}",
    'arena.lights=[{intensity=4.6, count=1, place="random"}]',
    'events=[{at_s=2.0, do="kill", robots={group="flock", share=0.3}, for_s=2.0}]',
]


def test_metrics_of_an_arena_are_the_same_alone_and_among_others():
    alone = run(LOSSY, seeds=[2], overrides=SETTING).arenas[0].metrics
    assert alone.keys() == METRICS.keys()
    beside = run(LOSSY, seeds=[5, 2, 3], overrides=SETTING).arenas[1].metrics
    assert beside == alone
    # What has no value is the same everywhere: nobody tells a number here, and some things do not happen.
    assert sum(summary.mean is not None for summary in alone.values()) > 0.7 * len(METRICS)
