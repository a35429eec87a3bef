"""What a world sends to runners: an inbox takes it or counts it, and what it takes the agents can act on."""

from typing import Any, NamedTuple

from swarmwire.agent.host import Host
from swarmwire.agent.runner import Inbox
from swarmwire.comms.errors import AgentFailed
from swarmwire.comms.senses import Senses
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.in_time_frames import encode_packets
from swarmwire.comms.wire.tick_frames import decode_tick
from tests.support.agent.hosts import PLAYERS
from tests.tools.fuzz.miniature import begun, senses_of
from tests.tools.fuzz.target import FrameTarget


class _NothingMore(Exception):
    """All that arrived was taken in."""


class _Payload(NamedTuple):
    data: bytes

    def to_bytes(self) -> bytes:
        return self.data


class _Sample(NamedTuple):
    payload: _Payload


class _Arrived:
    """In place of the queue: it ends, where that would wait."""

    def __init__(self, data: bytes) -> None:
        self._items = [_Sample(_Payload(data))]

    def empty(self) -> bool:
        return not self._items

    def get(self) -> _Sample:
        if not self._items:
            raise _NothingMore
        return self._items.pop()


class RunnerFrames(FrameTarget):
    """Frames to runners: tick, packets, end."""

    name = "told"
    quick = 1000

    def make_samples(self) -> list[bytes]:
        """Real ticks, packets between them, and the end."""
        self.miniature = of = begun()
        sound = decode_tick(frames.decode(of.told["one"][-1]), of.whole.gives or (), senses_of(of.parts, "one"))
        self.shapes = _shapes(sound[0])
        between = encode_packets(11, 1_150_000_000, 3, of.heard, of.outcomes)
        end = frames.encode("end", -1, {}, {"why": "it sent far more than it was asked for"})
        return [*of.told["one"][-3:], between, end]

    def door(self, case: bytes) -> str | None:
        """The inbox, and the agents behind it."""
        inbox, part = Inbox(), self.miniature.parts[0]
        inbox._arrived = _Arrived(case)
        host, became = self._host(), None
        try:
            for told in inbox.ticks(part, host.receive):
                became = self._act(host, told)
        except _NothingMore:
            return "dropped" if inbox.dropped else became
        return inbox.ended.how

    def _act(self, host: Host, told: Any) -> str | None:
        """What its agents raise themselves is theirs, and so is what the world does not tell them; nothing else."""
        self._kept = None  # agents may remember what no world told them
        try:
            host.hear(*told) if len(told) == 2 else host.act(*told)
        except AgentFailed as error:
            own = [line for line in error.traceback.splitlines() if line.startswith('  File "')]
            if str(PLAYERS) not in own[-1] and (len(told) == 2 or _shapes(told[1]) == self.shapes):
                raise AssertionError(error.traceback[-1500:]) from error
            return "the agents fail"
        return None

    def _host(self) -> Host:
        kept = getattr(self, "_kept", None) or Host(self.miniature.parts[0])
        self._kept = kept
        return kept


def _shapes(senses: Senses) -> Any:
    return {(name, sense): column.shape[1:] for name, group in senses.items() for sense, column in group.fields.items()}
