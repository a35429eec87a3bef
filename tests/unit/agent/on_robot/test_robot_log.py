import csv
import errno
import io
import json
from pathlib import Path

import pytest

from swarmwire.agent.drivers.driver import Command
from swarmwire.agent.on_robot.log import RowFile, TickRow, new_log
from swarmwire.agent.radios.radio import ReceivedPacket, SentPacket
from swarmwire.comms.errors import BadInput
from swarmwire.comms.packets import BROADCAST
from swarmwire.comms.wire.radio_bridge import Pose

ROBOTS = ("flock-0", "flock-1", "flock-2")
AT_NS = 1_795_000_000_000_000_123


def _log(folder: Path, own: str = "flock-1"):
    return new_log(folder / "log", ROBOTS, own, "20261121T030405Z", "robot.toml")


def _broadcast(sequence: int) -> SentPacket:
    return SentPacket(AT_NS, sequence, BROADCAST, 6, 1, "sent")


def _rows(file: Path) -> list[dict[str, str]]:
    with file.open(newline="") as lines:
        return list(csv.DictReader(lines))


def test_a_log_that_ended_has_all_its_files_and_rows(tmp_path):
    log = _log(tmp_path)
    log.begin({"format": 1, "name": "flock-1"})
    log.tick(TickRow(3, AT_NS, True, Pose(1.0, 2.5, -0.5), True, Command(0.05, -1.5), "search, slow", 2.5, 0.75))
    log.tick(TickRow(4, AT_NS, False, None, False, Command(), "", None, None))
    log.received(ReceivedPacket(AT_NS, 2, 7, BROADCAST, 6, 4660, latency_ns=1_500_000, distance_m=0.25, given=True))
    log.received(ReceivedPacket(AT_NS, 0, 8, 2, 6, 4660, latency_ns=None, distance_m=None, given=False))
    log.sent(SentPacket(AT_NS, 0, BROADCAST, 6, 4660, "sent"))
    log.sent(SentPacket(AT_NS, 1, 9, 600, 4660, "too_large"))
    log.end({"ended": "duration"})
    folder = tmp_path / "log" / "flock-1-20261121T030405Z"
    assert log.folder == folder
    assert json.loads((folder / "robot.json").read_text()) == {"format": 1, "name": "flock-1"}
    assert json.loads((folder / "summary.json").read_text()) == {"ended": "duration"}
    assert [list(row.values()) for row in _rows(folder / "ticks.csv")] == [
        ["3", "1795000000.000000123", "1", "1.0", "2.5", "-0.5", "1", "0.05", "-1.5", "search, slow", "2.5", "0.75"],
        ["4", "1795000000.000000123", "0", "", "", "", "0", "0.0", "0.0", "", "", ""],
    ]
    assert [list(row.values())[1:] for row in _rows(folder / "received.csv")] == [
        ["flock-2", "flock-1", "7", "", "6", "4660", "0.001500000", "0.25", "1"],
        ["flock-0", "flock-1", "8", "flock-2", "6", "4660", "", "", "0"],
    ]
    assert [list(row.values())[1:] for row in _rows(folder / "sent.csv")] == [
        ["flock-1", "0", "", "6", "4660", "sent"],
        ["flock-1", "1", "9", "600", "4660", "too_large"],
    ]


def test_a_log_of_a_process_that_was_killed_holds_what_was_flushed_and_no_summary(tmp_path):
    log = _log(tmp_path)
    log.sent(_broadcast(0))
    log.flush()
    log.sent(_broadcast(1))
    assert [row["seq"] for row in _rows(log.folder / "sent.csv")] == ["0"]
    assert (log.folder / "sent.csv").read_text().endswith("\n")
    assert _rows(log.folder / "ticks.csv") == []
    assert not (log.folder / "summary.json").exists()
    log.end({})


def test_no_start_writes_over_the_log_of_another(tmp_path):
    logs = [_log(tmp_path) for _ in range(3)]
    assert [log.folder.name for log in logs] == [f"flock-1-20261121T030405Z{end}" for end in ("", "-2", "-3")]
    for log in logs:
        log.end({})


def test_a_folder_that_cannot_be_written_to_is_refused_at_the_door(tmp_path):
    (tmp_path / "log").write_text("a file")
    with pytest.raises(BadInput, match=r"robot\.toml: log: expected a folder to write to"):
        _log(tmp_path)


class _Full:
    """A disk that takes so many bytes and no more, until there is room again."""

    def __init__(self, file: RowFile, room: int) -> None:
        self._raw, self.room = file._file, room

    def write(self, data) -> int:
        if self.room <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        taken = self._raw.write(data[: self.room])
        self.room -= taken
        return taken

    def __getattr__(self, name):
        return getattr(self._raw, name)


def test_a_full_disk_loses_rows_which_are_counted_and_leaves_whole_lines(tmp_path):
    file = RowFile(tmp_path / "rows.csv", ("a", "b"))
    file.write((1, "x"))
    file.flush()
    file._file = full = _Full(file, room=5)
    file.write((2, "y"))
    file.write((3, "z"))
    file.flush()
    assert file.lost_rows == 2
    assert file.fault is not None
    assert file.fault.errno == errno.ENOSPC
    assert (tmp_path / "rows.csv").read_text() == "a,b\n1,x\n"
    full.room = 100
    file.write((4, None))
    file.close()
    file.close()
    assert (file.lost_rows, file.fault) == (2, None)
    assert (tmp_path / "rows.csv").read_text() == "a,b\n1,x\n4,\n"


def test_a_disk_that_is_full_from_the_start_gets_the_header_once_there_is_room(tmp_path):
    file = RowFile(tmp_path / "rows.csv", ("a", "b"))
    file._file = full = _Full(file, room=0)
    file.write((1, "x"))
    file.flush()
    full.room = 100
    file.write((2, "y"))
    file.close()
    assert (tmp_path / "rows.csv").read_text() == "a,b\n2,y\n"
    assert file.lost_rows == 1


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has /dev/full, a disk that is always full")
def test_what_is_lost_of_a_log_is_counted(tmp_path):
    log = _log(tmp_path)
    log._sent._file.close()
    log._sent._file = io.FileIO("/dev/full", "wb")
    log.folder.joinpath("robot.json").mkdir()
    log.begin({})
    log.sent(_broadcast(0))
    log.flush()
    assert log.counts() == {"log_rows_lost": 1, "log_files_lost": 1}
    assert log.fault is not None
    assert log.fault.errno == errno.ENOSPC
    log.end({})
