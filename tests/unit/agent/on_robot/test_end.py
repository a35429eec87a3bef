import signal

import pytest

from swarmwire.agent.on_robot.end import SIGNALS, End, by_signals


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_asks_for_the_end_and_the_first_reason_stays(number):
    end = End()
    with by_signals(end, patient=True):
        assert not end
        signal.raise_signal(number)
        signal.raise_signal(signal.SIGTERM)
    assert end.reason == number.name


def test_a_second_interrupt_interrupts_an_agent_without_a_guard():
    end = End()
    with by_signals(end, patient=False):
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_signals_do_what_they_did_before_once_it_is_over():
    before = [signal.getsignal(number) for number in SIGNALS]
    with by_signals(End(), patient=False):
        pass
    assert [signal.getsignal(number) for number in SIGNALS] == before
