"""Asked once, a run ends after its tick; asked twice, at once; and what stood before stands again."""

import signal

import pytest

from swarmwire.deploy.interrupt import Interrupt

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
