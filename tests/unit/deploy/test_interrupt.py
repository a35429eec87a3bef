"""Asked once, a run ends after its tick; asked twice, at once; and what stood before stands again."""

import signal

import pytest
import typer

from swarmwire.comms.errors import Interrupted
from swarmwire.deploy.cli.process import leaving_when_hung_up
from swarmwire.deploy.controls import Interrupt

ASKING = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


def handlers() -> list[object]:
    return [signal.getsignal(number) for number in ASKING]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_asks_and_the_second_ends_at_once(number):
    with Interrupt() as interrupt:
        assert not interrupt.asked
        signal.raise_signal(number)
        assert (interrupt.asked, interrupt.hung_up) == (True, False)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)


def test_a_terminal_that_is_gone_asks_however_often_it_says_so():
    with Interrupt() as interrupt:
        for _ in range(3):
            signal.raise_signal(signal.SIGHUP)
        assert (interrupt.asked, interrupt.hung_up) == (True, True)


def test_whoever_handled_signals_before_does_so_again():
    before = handlers()
    with Interrupt():
        assert all(one != other for one, other in zip(handlers(), before, strict=True))
    assert handlers() == before


def test_a_hang_up_that_is_ignored_stays_so():
    """As nohup starts a program."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Interrupt() as interrupt:
            signal.raise_signal(signal.SIGHUP)
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
        assert not interrupt.asked
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_hang_up_before_the_first_tick_has_its_own_exit_code():
    interrupt = Interrupt()
    with pytest.raises(Interrupted), leaving_when_hung_up(interrupt):
        raise Interrupted("interrupted while it waited for its runners")
    interrupt.hung_up = True
    with pytest.raises(typer.Exit) as left, leaving_when_hung_up(interrupt):
        raise Interrupted("interrupted while it waited for its runners")
    assert left.value.exit_code == 129
