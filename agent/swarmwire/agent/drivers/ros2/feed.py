"""One topic of the base as it comes in: messages wait here until the agent looks."""

from collections import deque

from swarmwire.agent.drivers.ros2.readers import Fields, Reader
from swarmwire.comms.clock import Clock
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.robots.ros2.messages import Messages


class Feed:
    """Keeps the newest payloads, from whatever thread they come, and reads them where `look` is called.

    Attributes:
        senses: what the topic tells of.
        garbage: how many payloads were no messages.
    """

    def __init__(self, reader: Reader, messages: Messages, clock: Clock) -> None:
        self.senses = frozenset(field.split(".")[0] for field in reader.fields)
        self.garbage = 0
        self._reader, self._messages, self._clock = reader, messages, clock
        self._waiting: deque[tuple[int, bytes]] = deque(maxlen=reader.keeps)
        self._heard_ns: int | None = None  # when the newest message that could be read came

    def take(self, payload: bytes) -> None:
        """A payload came."""
        self._waiting.append((self._clock.now_ns(), payload))

    @property
    def is_blind(self) -> bool:
        """Whether nothing could be read since the connection was made, on a topic that a base tells all the time."""
        return self._reader.is_steady and self._heard_ns is None

    def begin(self) -> None:
        """A new connection: what came before does not count as heard."""
        self._waiting.clear()
        self._heard_ns = None

    def look(self) -> Fields:
        """The newest readings."""
        while self._waiting:
            came_ns, payload = self._waiting.popleft()
            try:
                self._reader.read(self._messages.decode(self._reader.kind, payload))
                self._heard_ns = came_ns
            except BadFrame:
                self.garbage += 1
        return self._reader.fields

    def silent_ns(self, now_ns: int, since_ns: int) -> int:
        """For how long nothing came that could be read, since `since_ns` at most; 0 if that is no fault."""
        if not self._reader.is_steady:
            return 0
        return now_ns - (since_ns if self._heard_ns is None else self._heard_ns)
