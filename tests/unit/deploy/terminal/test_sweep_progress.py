"""How campaigns are shown while they go on."""

import io

from rich.console import Console

from swarmwire.comms.clock import NS_PER_S
from swarmwire.deploy.campaign.task import PieceResult
from swarmwire.deploy.terminal.sweep_progress import SweepBar, SweepLines, sweep_progress


class Hand:
    """A clock that the test sets."""

    def __init__(self):
        self.now_s = 0.0

    def now_ns(self):
        return int(self.now_s * NS_PER_S)

    def sleep_until(self, at_ns):
        raise AssertionError("nobody waits here")


class Campaign:
    name, points, seeds, runs = "a [bold] flock", [{}, {}], list(range(50)), 100


def piece(runs, failed=0):
    return PieceResult(tuple({"run": run, "ended": "failed" if run < failed else "duration"} for run in range(runs)))


def printed(watcher_of, pieces, terminal, done=0):
    clock, text = Hand(), io.StringIO()
    watcher = watcher_of(clock, Console(file=text, force_terminal=terminal, width=110))
    watcher.begin(Campaign(), done, 0)
    for one in pieces:
        clock.now_s += 1.0
        watcher.see(one)
    watcher.end()
    return text.getvalue()


def test_plain_lines_tell_how_far_how_fast_and_how_long():
    lines = printed(SweepLines, [piece(25), piece(25, failed=2), piece(50)], terminal=False).splitlines()
    assert lines == [
        "a [bold] flock: 2 points x 50 seeds = 100 runs",
        "25/100 runs, 25.0 runs/s, 3 s left",
        "50/100 runs, 25.0 runs/s, 2 failed, 2 s left",
        "100/100 runs, 33.3 runs/s, 2 failed, 0 s left",
    ]


def test_many_pieces_are_a_few_lines_and_what_was_there_is_no_speed():
    lines = printed(SweepLines, [piece(1)] * 60, terminal=False, done=40).splitlines()
    assert lines[0].endswith("; 40 of them are there")
    assert len(lines) == 7
    assert lines[-1] == "100/100 runs, 1.0 runs/s, 0 s left"


def test_a_bar_shows_the_same():
    text = printed(SweepBar, [piece(25, failed=1)], terminal=True)
    assert "a [bold] flock" in text
    assert "25/100" in text
    assert "1 failed" in text


def test_a_terminal_gets_a_bar_and_all_else_lines():
    assert isinstance(sweep_progress(Console(file=io.StringIO(), force_terminal=True)), SweepBar)
    assert isinstance(sweep_progress(Console(file=io.StringIO())), SweepLines)
