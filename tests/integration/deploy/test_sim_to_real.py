"""`swarmwire sim-to-real` and `swarmwire radio fit` of robots' logs: what they print, write and refuse."""

import csv
import json
import re
import tomllib

import numpy as np
import pytest
import tomli_w

from swarmwire.deploy import run
from swarmwire.deploy.campaigns.sweep import sweep
from tests.support.deploy.runs import LOSSY, called, refused_command
from tests.support.metrics.real_logs import METRICS, SMALL, as_bag, as_logs, flock, watched


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A run's folder, and the logs that its robots would have written."""
    folder = tmp_path_factory.mktemp("sim-to-real")
    return folder / "run", as_logs(watched(out=folder / "run"), folder / "logs")


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Three seeds of the same scenario with two losses."""
    to = tmp_path_factory.mktemp("campaigns") / "lab"
    sweep(LOSSY, seeds=[1, 2, 3], vary={"radio.loss": [0.3, 0.6]}, overrides=[*SMALL, METRICS], out=to, workers=1)
    return to


def test_sim_to_real_of_a_run_prints_it_beside_its_logs(folders, monkeypatch, capsys):
    code, out, errors = called(monkeypatch, capsys, "sim-to-real", *folders)
    assert (code, errors) == (0, "")
    head = next(line for line in out.splitlines() if line.startswith("metric"))
    assert head.split() == ["metric", "emulated", "log", "distance", "spread", "KS", "within"]
    assert "agent's file: sha256 " in out
    assert "different robots" not in out
    assert "not in the log: collisions, wall_contacts" in out
    assert "means" in out.splitlines()[-1]


def test_differences_of_settings_stand_before_the_numbers(folders, tmp_path, monkeypatch, capsys):
    logs = as_logs(watched("robots.flock.count=5"), tmp_path / "logs")
    for robot in logs.iterdir():
        says = json.loads((robot / "robot.json").read_text())
        says["body"]["radius_m"] = 0.04
        (robot / "robot.json").write_text(json.dumps({**says, "rate_hz": 20, "params": {"alignment": 2.0}}))
    code, out, _ = called(monkeypatch, capsys, "sim-to-real", folders[0], logs)
    assert code == 0
    lines = [line for line in out.splitlines() if line.startswith("note: different ")]
    for text in ("robots: 6 .*5", "10 Hz .*20 Hz", "separation_m 0.8 .*0.4 .*alignment 1.0 .*2.0", "body epuck"):
        assert any(re.search(text, line) for line in lines), text
    assert out.splitlines()[0] == lines[0]


def test_another_agent_is_named(folders, tmp_path, monkeypatch, capsys):
    logs = as_logs(flock(), tmp_path / "logs", about={"agent": "walk.py:Walk"})
    out = called(monkeypatch, capsys, "sim-to-real", folders[0], logs)[1]
    assert re.search("swarmwire.agent.behaviours:Flocking .*walk.py:Walk ", out)


def test_sim_to_real_of_a_campaign_prints_a_spread(campaign, folders, monkeypatch, capsys):
    code, out, errors = called(monkeypatch, capsys, "sim-to-real", f"{campaign}@radio.loss=0.3", folders[1])
    assert (code, errors) == (0, "")
    assert "over 3 runs" in out.splitlines()[-1]
    order = next(line for line in out.splitlines() if line.startswith("order "))
    assert order.endswith("yes")  # it is one of them
    pdr = next(line for line in out.splitlines() if line.startswith("total pdr "))
    assert " to " in pdr


def test_shorter_log_is_not_compared_with_a_longer_runs_totals(folders, campaign, tmp_path, monkeypatch, capsys):
    logs = as_logs(watched("duration_s=8"), tmp_path / "logs")
    out = called(monkeypatch, capsys, "sim-to-real", f"{campaign}@radio.loss=0.3", logs)[1]
    assert not [line for line in out.splitlines() if line.startswith(("total pdr ", "packets sent", "latency p50"))]
    line = next(line for line in out.splitlines() if line.startswith("not compared: packets sent, total pdr, latency "))
    assert "20 s" in line
    out = called(monkeypatch, capsys, "sim-to-real", folders[0], logs)[1]  # a run folder has counts of each tick
    assert [line for line in out.splitlines() if line.startswith("packets sent")]
    assert "not compared: total pdr, latency " in out or "not compared: latency " in out


def test_numbers_and_a_page_are_written(folders, tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib", reason="needs the extra [report]")
    page, table = tmp_path / "sim-to-real.html", tmp_path / "sim-to-real.csv"
    code, out, _ = called(monkeypatch, capsys, "sim-to-real", *folders, "--to", page, "--to", table)
    assert (code, out.splitlines()[-2:]) == (0, [f"written: {page}", f"written: {table}"])
    text = page.read_text()
    assert "data:image/svg+xml" in text
    assert "Side by side" in text
    assert (tmp_path / "sim-to-real-figures" / "sim-to-real-order.svg").exists()
    rows = {row["name"]: row for row in csv.DictReader(table.read_text().splitlines())}
    assert float(rows["order"]["log"]) == pytest.approx(float(rows["order"]["emulated_q50"]), abs=0.01)
    assert rows["collisions"]["what"] == "not in the log"
    assert rows["collisions"]["log"] == ""
    assert rows["total pdr"]["what"] == "radio"


def test_sim_to_real_arguments_that_are_invalid_are_refused_in_one_line(
    folders, campaign, tmp_path, monkeypatch, capsys
):
    run, logs = folders
    (tmp_path / "empty").mkdir()
    for arguments, message in (
        ((tmp_path / "empty", logs), f"{tmp_path}/empty: "),
        ((run, tmp_path / "empty"), "robot.json"),
        ((run, tmp_path / "none"), f"{tmp_path}/none: "),
        ((campaign, logs), "one design point of 2"),
        ((f"{campaign}@radio.loss=0.5", logs), "radio.loss: "),
        ((run, logs, "--to", "sim-to-real.pdf"), ".html or .csv"),
    ):
        refused_command(monkeypatch, capsys, "sim-to-real", *arguments, match=f".*{message}")


def test_fit_of_a_swarms_logs_gives_a_radio_that_a_scenario_takes(folders, tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib", reason="needs the extra [report]")
    to = ["--to", tmp_path / "fit.png", "--to", tmp_path / "radio.toml"]
    code, out, errors = called(monkeypatch, capsys, "radio", "fit", folders[1], *to)
    assert (code, errors) == (0, "")
    for text in ("latency", "jitter", "delivery by link", "neighbours of flock-0: flock-1", "all losses count here"):
        assert text in out
    assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG")
    table = tomllib.loads((tmp_path / "radio.toml").read_text())["radio"]
    assert table["latency_s"] == pytest.approx(0.1, abs=0.002)
    scenario = tomllib.loads(LOSSY.read_text())
    refitted = tmp_path / "refitted.toml"
    refitted.write_text(tomli_w.dumps({**scenario, "radio": table}))
    assert run(refitted, overrides=["duration_s=0.2"]).ticks > 0  # whose agents need range and bearing


def test_fit_of_a_missing_log_is_refused(tmp_path, monkeypatch, capsys):
    for name in ("lgos", "received.csv"):
        refused_command(monkeypatch, capsys, "radio", "fit", tmp_path / name, match=f"{tmp_path / name}: ")


def test_fit_of_a_single_robots_table_is_possible(folders, monkeypatch, capsys):
    log = folders[1] / "flock-0" / "received.csv"
    code, out, errors = called(monkeypatch, capsys, "radio", "fit", log)
    assert (code, errors) == (0, "")
    assert "on 5 links" in out
    assert tomllib.loads(out[out.index("# Fitted to received.csv") :])["radio"]["loss"] == pytest.approx(0.3, abs=0.1)
    refused_command(monkeypatch, capsys, "radio", "fit", log, "--within", "0.01", match="--within: ")


def test_latencies_that_are_not_uniform_are_drawn_and_become_a_table(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib", reason="needs the extra [report]")
    late_s = np.random.default_rng(4).lognormal(-4.0, 0.8, 1000)
    rows = [f"{1000.0 + 0.1 * i:.6f},a,b,{i},{late:.6f}" for i, late in enumerate(late_s.tolist())]
    log, picture = tmp_path / "received.csv", tmp_path / "fit.png"
    log.write_text("\n".join(["t_s,tx,rx,seq,latency_s", *rows]) + "\n")
    code, out, errors = called(monkeypatch, capsys, "radio", "fit", log, "--to", picture)
    assert (code, errors) == (0, "")
    assert tomllib.loads(out[out.index("# Fitted to ") :])["radio"]["delays"]["distribution"] == "lognormal"
    assert picture.read_bytes().startswith(b"\x89PNG")


OSCILLATING = [*SMALL, 'metrics=["speed", "order", "oscillation", "link_pdr", "latency_air"]']
POSES = ("--poses", "/{name}/pose")


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    """A run, the logs that its robots would have written, and a bag with the same content."""
    folder = tmp_path_factory.mktemp("bags")
    logs = as_logs(watched(*OSCILLATING[len(SMALL) :], out=folder / "run"), folder / "logs")
    return folder / "run", logs, as_bag(logs, folder / "bag")


def table(path):
    with path.open() as file:
        return list(csv.reader(file))


def test_bag_of_robots_is_compared_as_their_logs_are(bags, tmp_path, monkeypatch, capsys):
    run, logs, bag = bags
    for source, to in ((logs, "logs.csv"), (bag, "bag.csv")):
        topics = POSES if source == bag else ()
        code, _, errors = called(monkeypatch, capsys, "sim-to-real", run, source, *topics, "--to", tmp_path / to)
        assert (code, errors) == (0, "")
    of_logs, of_bag = table(tmp_path / "logs.csv"), table(tmp_path / "bag.csv")
    assert {"speed", "order", "oscillation", "link_pdr", "latency_air"} <= {row[0] for row in of_bag}
    for expected, row in zip(of_logs, of_bag, strict=True):
        for value, number in zip(expected, row, strict=True):
            try:
                assert float(number) == pytest.approx(float(value), rel=1e-4, abs=1e-5, nan_ok=True)
            except ValueError:
                assert number == value


def test_radio_fitted_to_a_bag_is_that_of_the_logs(bags, monkeypatch, capsys):
    _, logs, bag = bags
    tables = []
    for source, topics in ((logs, ()), (bag, POSES)):
        code, out, _ = called(monkeypatch, capsys, "radio", "fit", source, *topics)
        assert code == 0
        tables.append(tomllib.loads(out[out.index("# Fitted") :])["radio"])
    of_logs, of_bag = tables
    assert of_bag.keys() == of_logs.keys()
    assert of_bag["loss"] == of_logs["loss"]
    assert of_bag["latency_s"] == pytest.approx(of_logs["latency_s"], abs=1e-5)


def test_what_a_bag_lacks_is_left_out_and_said(bags, tmp_path, monkeypatch, capsys):
    run, logs, _ = bags
    bag = as_bag(logs, tmp_path / "poses", commands=False, packets=False)
    code, out, _ = called(monkeypatch, capsys, "sim-to-real", run, bag, *POSES)
    assert code == 0
    rows = {line.split()[0] for line in out.splitlines() if line}
    assert {"speed", "order"} <= rows
    assert not rows & {"oscillation", "link_pdr", "latency_air", "packets", "total"}
    assert re.search("note: no packets.*\nnote: no commands", out)

    blind = as_bag(logs, tmp_path / "blind", commands=False)
    out = called(monkeypatch, capsys, "sim-to-real", run, blind)[1]  # /NAME/odom, which is not there
    rows = {line.split()[0] for line in out.splitlines() if line}
    assert {"latency_air", "total"} <= rows
    assert not rows & {"speed", "order"}


@pytest.mark.parametrize(
    ("options", "text", "where"),
    [
        (("--poses", "/pose"), None, "--poses"),
        (("--poses", "/{name}/gps"), None, "--poses"),
        (("--packets", "/{name}/radio"), None, "--packets"),
        ((), '{"t_s": 1.0}', "message 1 of /flock_0/packets"),
        ((), '{"t_s": 1.0, "seq": -1}', "message 1 of /flock_0/packets"),
        ((), "seq 7", "message 1 of /flock_0/packets"),
    ],
)
def test_topics_and_packets_that_cannot_be_read_are_refused(bags, options, text, where, tmp_path, monkeypatch, capsys):
    bag = bags[2]
    if text is not None:
        bag = as_bag(bags[1], tmp_path / "bad", first_text=text)
    code, _, errors = called(monkeypatch, capsys, "radio", "fit", bag, *options)
    assert code != 0
    assert where in errors
    assert errors.count("\n") == 1
