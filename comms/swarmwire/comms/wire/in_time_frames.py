"""What crosses the wire in the middle of a tick, in real time with a quantum: packets to a runner, packets back."""

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.outcomes import Outcomes
from swarmwire.comms.packets import Heard, Sent
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import Frame
from swarmwire.comms.wire.tick_frames import sent_arrays, sent_of, told_arrays, told_of


def encode_packets(tick: int, at_ns: int, number: int, heard: Heard, outcomes: Outcomes) -> bytes:
    """A `packets` frame: what a runner's robots heard since the last, and learned of their own packets.

    It is handed over at `at_ns` of simulated time, in `tick`; `number` counts these frames to a runner from 0.
    """
    return frames.encode("packets", tick, told_arrays(heard, outcomes), {"at_ns": at_ns, "number": number})


def decode_packets(frame: Frame, gives: tuple[str, ...]) -> tuple[int, int, Heard, Outcomes]:
    """Time, number and what else `encode_packets` was given; BadFrame if the frame does not hold it."""
    at_ns, number = frame.values.get("at_ns"), frame.values.get("number")
    if type(at_ns) is not int or type(number) is not int:
        raise BadFrame("malformed", "expected at_ns and number")
    try:
        return at_ns, number, *told_of(frame, gives)
    except (KeyError, ValueError) as error:
        raise BadFrame("malformed", f"an array is missing or of the wrong shape: {error}") from error


def encode_sent(tick: int, sent: Sent, missed: int = 0) -> bytes:
    """A `sent` frame: what robots sent between ticks; `missed` counts `packets` frames that never came."""
    return frames.encode("sent", tick, sent_arrays(sent), {"missed": missed} if missed else {})


def decode_sent(frame: Frame, rows: IntArray) -> Sent:
    """Packets of the robots `rows`; BadFrame if there are none, or some of others."""
    if "sent" not in frame.arrays:
        raise BadFrame("malformed", "expected packets")
    return sent_of(frame, rows)
