"""`swarmwire radio fit`, in this process: what it prints, draws and writes, and what it refuses."""

import math
import re
import tomllib

import pytest

from swarmwire.world.scenario_file import scenario_from
from tests.support.deploy.runs import ROOT, called

HEAD = "t_s,tx,rx,seq,rssi_dbm,distance_m\n"
SMALL = HEAD + "".join(f"{i},a,b,{i},{-50 - i},{1 + i}\n" for i in range(20))


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_without_a_file_the_table_is_printed_and_what_is_left_out_is_named(here, monkeypatch, capsys):
    (here / "log.csv").write_text(SMALL)
    code, out, _ = called(monkeypatch, capsys, "radio", "fit", "log.csv")
    assert code == 0
    for said in ("shadowing: needs positions", "losses: needs 100 packets, got 20"):
        assert f"left out: {said}" in out
    assert "log_distance" in tomllib.loads(out[out.index("# Fitted to") :])["radio"]


def rows(count, rssi_dbm, distance_m, received=lambda _: True):
    lines = (f"{i},a,b,{i},{rssi_dbm(i) if received(i) else ''},{distance_m(i)}\n" for i in range(count))
    return HEAD + "".join(lines)


def falling(i):
    return -50.0 - 30.0 * math.log10(1 + i % 20)


LOGS = {
    "falls": rows(200, falling, lambda i: 1 + i % 20),
    "strong": rows(200, lambda i: 90.0 + falling(i), lambda i: 1 + i % 20),
    "rises": rows(200, lambda i: -60 + i % 20, lambda i: 1 + i % 20),
    "one-place": rows(200, lambda _: -60, lambda _: 2, lambda i: i % 7),
    "bursts": rows(2000, lambda _: -60, lambda _: 2, lambda i: i % 50 > 9),
    "far": rows(200, falling, lambda i: 10.0 ** (i % 20)),
}


@pytest.mark.parametrize("name", LOGS)
def test_whatever_is_written_a_scenario_takes(here, monkeypatch, capsys, name):
    (here / "log.csv").write_text(LOGS[name])
    code, _, errors = called(monkeypatch, capsys, "radio", "fit", "log.csv", "--write", "radio.toml")
    assert (code, errors) == (0, "")
    text = (here / "radio.toml").read_text()
    radio = tomllib.loads(text)["radio"]
    scenario = tomllib.loads((ROOT / "scenarios" / "flocking-lossy.toml").read_text())
    whole = "model" in radio
    assert whole == (name in ("falls", "strong"))
    assert ("# Without path loss this is no radio yet" in text) == ("# Left out: path loss: " in text) == (not whole)
    kept = {} if whole else {"range_m": 2.0}
    taken = scenario_from({**scenario, "radio": {**kept, **radio}}, "radio.toml").radio
    assert taken is not None
    assert ("bursts" in radio) == (name == "bursts")


@pytest.mark.parametrize(
    ("text", "reasons"),
    [
        (f"{HEAD}0,a,b,0,-50,1\n", ("path loss: needs 10 ", "losses: needs 100 ")),
        (
            rows(150, falling, lambda _: 2, lambda _: False),
            ("got 0", "losses: .*150"),
        ),
        (rows(50, lambda _: -60, lambda _: 2), ("path loss: .*distances", "losses: needs 100 ")),
        (rows(50, lambda _: -60, lambda i: 1 + i), ("path loss: RSSI", "losses: needs 100 ")),
    ],
)
def test_a_log_that_tells_nothing_is_refused_with_the_reasons_and_nothing_is_written(
    here, monkeypatch, capsys, text, reasons
):
    (here / "log.csv").write_text(text)
    code, out, errors = called(monkeypatch, capsys, "radio", "fit", "log.csv", "--write", "radio.toml")
    assert (code, out) == (2, "")
    assert errors.startswith("error: log.csv: ")
    assert errors.count("\n") == 1
    assert all(re.search(reason, errors) for reason in reasons)
    assert not (here / "radio.toml").exists()


def test_a_fit_beyond_what_a_scenario_takes_is_refused_with_the_key(here, monkeypatch, capsys):
    slow = (f"{i * 1e6},a,b,{i},{-60 if i % 50 > 9 else ''},2\n" for i in range(2000))
    (here / "log.csv").write_text(HEAD + "".join(slow))
    code, out, errors = called(monkeypatch, capsys, "radio", "fit", "log.csv")
    assert (code, out) == (2, "")
    assert errors.startswith("error: log.csv: fitted radio.bursts.")
    assert "no scenario takes" in errors


def test_one_packet_is_no_packets(here, monkeypatch, capsys):
    (here / "log.csv").write_text(SMALL)
    assert "20 packets on 1 link, 20 received" in called(monkeypatch, capsys, "radio", "fit", "log.csv")[1]


@pytest.mark.parametrize(
    ("arguments", "where"),
    [
        (["log.csv", "--power-dbm", "nan"], "--power-dbm"),
        (["log.csv", "--gain-dbi", "nan"], "--gain-dbi"),
        (["log.csv", "--power-dbm", "inf"], "--power-dbm"),
        (["absent.csv"], "absent.csv"),
        (["log.csv", "--write", "radio.json"], "radio.json"),
        (["log.csv", "--write", "absent/radio.toml"], "absent/radio.toml"),
        (["log.csv", "--to", "fit.bmp"], "fit.bmp"),
        (["log.csv", "--within", "0.5"], "--within"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(here, monkeypatch, capsys, arguments, where):
    (here / "log.csv").write_text(SMALL)
    code, out, errors = called(monkeypatch, capsys, "radio", "fit", *arguments)
    assert (code, out, errors.count("\n")) == (2, "", 1)
    assert errors.startswith(f"error: {where}: ")


def test_brackets_in_notes_are_printed_as_they_are(here, monkeypatch, capsys):
    rows = [f"{0.1 * i},a,b,{i},{0.9 if i % 4 == 0 else 0.01 + 1e-5 * i}\n" for i in range(200)]
    (here / "received[1].csv").write_text("t_s,tx,rx,seq,latency_s\n" + "".join(rows))
    code, out, _ = called(monkeypatch, capsys, "radio", "fit", "received[1].csv")
    assert code == 0
    assert out.startswith("received[1].csv: 200 packets")
    assert "no distribution of [radio.delays] fits" in " ".join(out.split())
