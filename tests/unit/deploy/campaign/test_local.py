"""Workers of this machine: their messages, and how long one may send nothing."""

from swarmwire.comms.clock import NS_PER_S
from swarmwire.deploy.campaign.local import Silence, receive, send
from swarmwire.deploy.campaign.worker import MAX_SILENCE_S
from tests.support.clocks import FakeClock


def test_the_time_without_a_message_adds_up_but_not_while_the_campaign_itself_was_frozen():
    clock = FakeClock()
    silence = Silence(clock)
    clock.time_ns += 3600 * NS_PER_S  # Ctrl-Z, and fg
    assert not silence.too_long()
    for _ in range(int(MAX_SILENCE_S) - 1):
        clock.time_ns += NS_PER_S
        assert not silence.too_long()
    clock.time_ns += NS_PER_S
    assert silence.too_long()
    silence.broken()
    assert not silence.too_long()


def test_a_message_arrives_complete_or_not_at_all(tmp_path):
    path = tmp_path / "messages"
    with path.open("wb") as file:
        send(file, {"a": [1, None, "x"], "b": b"\0"})
        send(file, {})
    whole = path.read_bytes()
    with path.open("rb") as file:
        assert [receive(file), receive(file), receive(file)] == [{"a": [1, None, "x"], "b": b"\0"}, {}, None]
    for length in range(1, whole.index(b"x")):
        path.write_bytes(whole[:length])
        with path.open("rb") as file:
            assert receive(file) is None
