"""What a run shows of itself while it goes on, and what of it cannot be shown."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.robot.tick_io import GroupReadings
from swarmwire.deploy.cli.view import view_command
from swarmwire.deploy.live import viewer
from swarmwire.deploy.live.drawing import CarriedRounding
from swarmwire.deploy.runs.published import PendingTicks, Sampling
from tests.support.metrics.truths import edges, finished, static, tally, truth
from tests.support.refusals import refused_input


def test_large_swarms_show_fewer_links_the_senses_of_one_and_no_flood_of_packets():
    run = static(300)
    sensors = {"flock": GroupReadings(np.arange(300), {"compass.heading_rad": np.arange(300.0)})}
    full = truth(run, edges=edges((0, 1)), readings=sensors, finished=finished([0] * 2001, [1] * 2001))
    sampling, values = Sampling(run, run.robot_names[7]), np.zeros((1, 1))
    shown = [sampling.frame(full, 1, values, at * NS_PER_S // 30).truth for at in range(30)]
    assert sum(glimpse.edges is not None for glimpse in shown) == 5
    sensed = shown[0].readings["flock"]
    assert sensed.rows.tolist() == sensed.fields["compass.heading_rad"].tolist() == [7]
    assert shown[0].finished is None
    few = finished([0] * 2000, [1] * 2000)
    assert sampling.frame(replace(full, finished=few), 1, values, 0).truth.finished == few


def test_ticks_are_taken_once():
    since = PendingTicks()
    since.add(truth(run := static(2), 0))
    since.add(truth(run, 1))
    together, ticks = since.pop()
    assert (together.tick, ticks) == (1, 2)
    with pytest.raises(ValueError, match="expected a tick"):
        since.pop()


@pytest.mark.parametrize("content", [b"", b"hello"])
def test_recording_file_that_is_invalid_is_refused(tmp_path, content):
    (tmp_path / "run.rrd").write_bytes(content)
    for shown in (tmp_path, tmp_path / "run.rrd"):
        with refused_input(match=r"run\.rrd: "):
            view_command(shown)


@pytest.mark.parametrize("content", [{}, {"live.json": "{}"}, {"live.json": "nothing"}])
def test_view_without_a_recording_or_live_run_is_refused(tmp_path, content):
    for name, text in content.items():
        (tmp_path / name).write_text(text)
    for shown in (tmp_path, tmp_path / "none.rrd") if not content else (tmp_path,):
        with refused_input(match=f"{tmp_path}.*: expected "):
            view_command(shown)


def test_without_rerun_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("swarmwire.comms.base.extras.find_spec", lambda _: None)
    with refused_input("view", match=r"swarmwire\[view\]"):
        view_command(tmp_path)


def test_viewer_has_a_screen_only_with_a_display(monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert not viewer.has_screen()
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    assert viewer.has_screen()


def test_tallies_of_several_ticks_are_evened_to_single_ones_without_a_loss():
    evened = CarriedRounding()
    single = [evened.per_tick(tally({0: 2, 3: 1}, sent=1), 3) for _ in range(9)]
    assert sum(one.fates[0, 0] for one in single) == 6  # nine times two thirds
    assert sum(one.sent[0] for one in single) == sum(one.in_range[0] for one in single) / 3 == 3
