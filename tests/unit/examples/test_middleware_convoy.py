"""The motion of cars for the experiment on middleware, from a file of the form in which OpenACC has it."""

import csv
import hashlib

import pytest

from examples.middleware import convoy

CARS = list(convoy.CARS)
HEAD = ",".join(["Time", *(f"{axis}{car}" for car in range(1, 12) for axis in "EN")])


def test_convoy_samples_are_metres_from_the_middle_of_all_within_the_window():
    def line(at_s, shift_m):
        cells = [f"{car + shift_m},{100 * car}" if car in CARS else "," for car in range(1, 12)]
        return f"{at_s},{','.join(cells)}"

    text = "\n".join(["Date,9,10,2019", HEAD, line(549.9, 0.0), line(550.0, 0.0), line(620.0, 1.0), line(620.1, 9.0)])
    samples = convoy.samples(text)
    # East from 2 to 9 + 1, north from 200 to 900: the middle is (6, 550).
    assert samples[0] == (0.0, 2, -4.0, -350.0)
    assert samples[-1] == (70.0, 9, 4.0, 350.0)
    assert len(samples) == 16


def test_convoy_refuses_a_file_that_is_another_one(tmp_path, monkeypatch):
    monkeypatch.setattr(convoy, "FILE", tmp_path / "convoy.csv")
    (tmp_path / "raw.csv").write_text("Time\n")
    with pytest.raises(SystemExit, match="SHA-256"):
        convoy.main([str(tmp_path / "raw.csv")])
    assert not convoy.FILE.exists()


def test_convoy_writes_a_table_that_traces_take(tmp_path, monkeypatch):
    monkeypatch.setattr(convoy, "FILE", tmp_path / "convoy.csv")
    data = f"{HEAD}\n550.0,{','.join(f'{car},{2 * car}' for car in range(1, 12))}\n".encode("latin-1")
    monkeypatch.setattr(convoy, "SHA256", hashlib.sha256(data).hexdigest())
    (tmp_path / "raw.csv").write_bytes(data)
    convoy.main([str(tmp_path / "raw.csv")])
    rows = list(csv.DictReader(convoy.FILE.read_text().splitlines()))
    assert rows[0] == {"t_s": "0.0", "robot": "2", "x_m": "-3.50", "y_m": "-7.00"}
    assert [row["robot"] for row in rows] == [str(car) for car in CARS]
