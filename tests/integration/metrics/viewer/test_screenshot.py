import struct

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.viewer.recording import RerunRecording
from swarmwire.metrics.viewer.screenshot import NoGraphics, render_png
from tests.support.clocks import StillClock
from tests.support.metrics.truths import static, truth, watch

pytest.importorskip("rerun", reason="needs the extra [view]")


@pytest.fixture
def rrd(tmp_path):
    of, metrics = static(3), Metrics()
    recording = RerunRecording(tmp_path / "run.rrd", metrics, StillClock())
    x_m = np.linspace(-2, 2, 3)
    poses = (np.column_stack([x_m, np.full(3, 0.1 * tick), np.zeros(3)]) for tick in range(20))
    watch(of, (truth(of, tick, pose=pose) for tick, pose in enumerate(poses)), metrics, recording)
    recording.end(None)
    return tmp_path / "run.rrd"


def picture(rrd, name, at_s=None):
    png = rrd.with_name(name)
    try:
        render_png(rrd, png, at_s, size=(640, 360))
    except NoGraphics as fault:
        pytest.skip(str(fault))
    return png.read_bytes()


def test_a_picture_has_the_size_asked_for_and_shows_the_time_asked_for(rrd):
    last_s = 19 / static(3).rate_hz
    first, last, end = picture(rrd, "0.png", 0.0), picture(rrd, "19.png", last_s), picture(rrd, "end.png")
    assert struct.unpack(">II", first[16:24]) == (640, 360)
    assert first != last
    assert last == end


def test_a_machine_without_a_driver_is_told_what_it_lacks(rrd, monkeypatch):
    monkeypatch.setenv("VK_ICD_FILENAMES", "/dev/null")
    monkeypatch.setenv("VK_DRIVER_FILES", "/dev/null")
    with pytest.raises(NoGraphics, match="mesa-vulkan-drivers"):
        render_png(rrd, rrd.with_name("none.png"))


@pytest.mark.parametrize("tick", [-1, 20])
def test_a_time_that_was_not_recorded_is_refused(rrd, tick):
    with pytest.raises(BadInput, check=lambda error: error.where == "--at" and "recorded" in error.expected):
        picture(rrd, "none.png", tick / static(3).rate_hz)


def test_a_recording_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(BadInput, check=lambda error: error.where == str(tmp_path / "none.rrd")):
        render_png(tmp_path / "none.rrd", tmp_path / "none.png")


@pytest.mark.parametrize("name", ["x.txt", "x", "x.jpg"])
def test_what_is_no_png_by_name_is_refused(rrd, name):
    with pytest.raises(BadInput, check=lambda error: error.where == str(rrd.with_name(name))):
        render_png(rrd, rrd.with_name(name))
    assert not rrd.with_name(name).exists()
