"""Recorded packets as lines of films."""

import numpy as np
import pytest

from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy import Recording, RunFolder, run
from swarmwire.metrics.pictures.drawing.animation import FilmFigure
from swarmwire.metrics.pictures.drawing.film import film_of
from swarmwire.metrics.pictures.drawing.packets import PacketEnds, packets_of
from tests.support.deploy.runs import ROOT
from tests.support.metrics.films import film

pytest.importorskip("matplotlib", reason="needs the extra [report]")
FLOOR = (0xF4, 0xF6, 0xF9)
ENDED = 10  # the tick in which the packet of the films below ended
OVERRIDES = ["duration_s=2", "radio.loss=0.4", "events.0.at_s=1.0", "events.0.for_s=0.5"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> RunFolder:
    """Two seconds in which packets are lost, and for half a second the arena's halves are kept apart."""
    out = tmp_path_factory.mktemp("runs") / "partition"
    run(ROOT / "scenarios" / "partition.toml", overrides=OVERRIDES, out=out, record=Recording(packets=1.0, rrd=False))
    return RunFolder(out)


def colors_on_the_way(fate: Fate, index: int) -> list[tuple[int, ...]]:
    """In a tick, at 0.3 and 0.6 of the way of the one packet between two robots in range, where no trail is."""
    run = film()
    first = (np.arange(len(run.time_s) + 1) > ENDED).astype(np.int64)
    figure = FilmFigure(run, 640, packets=PacketEnds(first, np.array([0]), np.array([1]), np.array([fate])))
    image = figure.frame(index)
    start_m, end_m = run.pose[index, :2, :2].astype(float)
    places = figure._figure.axes[0].transData.transform([start_m + share * (end_m - start_m) for share in (0.3, 0.6)])
    return [tuple(image[int(len(image) - up), int(column)].tolist()) for column, up in places]


def test_packet_received_is_a_line_to_its_receiver_and_lost_ends_on_the_way():
    (near, far), (near_lost, far_lost) = colors_on_the_way(Fate.RECEIVED, ENDED), colors_on_the_way(Fate.LOST, ENDED)
    assert near[2] > near[0], "blue"
    assert far == near
    assert near_lost[0] > near_lost[2], "red"
    assert far_lost == FLOOR


@pytest.mark.parametrize("index", [ENDED - 1, ENDED + 1])
def test_packet_is_drawn_only_in_the_tick_of_its_end_and_replaces_links(index):
    assert colors_on_the_way(Fate.RECEIVED, index) == [FLOOR, FLOOR]


def test_packets_in_a_film_are_as_many_per_tick_as_the_run_counted(folder):
    run = film_of(folder, 0, "run")
    packets = packets_of(folder, run)
    assert packets is not None
    fates = [packets.ended_in(tick)[1] for tick in range(len(run.time_s))]
    counted = folder.ticks(0)["received"].to_list()
    assert [int((fate == Fate.RECEIVED).sum()) for fate in fates] == counted
    assert packets.fates == (Fate.RECEIVED, Fate.LOST, Fate.PARTITIONED)
    parted_s = {run.time_s[tick] for tick, fate in enumerate(fates) if (fate == Fate.PARTITIONED).any()}
    assert 1.0 < min(parted_s) <= max(parted_s) <= 1.7


def test_packets_of_a_run_that_recorded_none_are_absent_from_its_film(tmp_path):
    run(ROOT / "scenarios" / "partition.toml", overrides=["duration_s=0.2"], out=tmp_path / "run")
    folder = RunFolder(tmp_path / "run")
    assert packets_of(folder, film_of(folder, 0, "run")) is None
