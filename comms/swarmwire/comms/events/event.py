"""What an event is: a frozen dataclass of parameters that knows how to begin, and how to end if it lasts."""

from abc import ABC, abstractmethod
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from typing import ClassVar, cast

from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.config import parameter
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.effects import ActiveEffects
from swarmwire.comms.events.selection import Groups, Selection, Swarm
from swarmwire.comms.radio.config.radio import Radio


@dataclass(frozen=True, kw_only=True)
class Event(ABC):
    """Something that happens to the robots of every arena at a time of the run.

    It takes effect at the first tick that starts at `at_s` or later; one after the end of the run never does. What it
    changes are the `Conditions` under which world and air then go on, so it need know neither.
    """

    at_s: float = parameter(help="when it happens", unit="s", at_least=0, at_most=1e9)
    do: str = parameter(help="what happens")
    needs_radio: ClassVar[bool] = False
    needs_signals: ClassVar[bool] = False  # whose strength a radio knows

    @property
    def lasts_s(self) -> float | None:
        """How long until it is undone; None: never."""
        return None

    @property
    def undoable(self) -> bool:
        """Whether it goes on until somebody or its own time undoes it; else it happens once."""
        return False

    @property
    def words(self) -> str:
        """What it does, as a scenario would say it: the action, and what is not left out."""
        of_it = [of for of in fields(self) if of.name not in ("at_s", "do") and getattr(self, of.name) != of.default]
        of_it.sort(key=lambda of: of.name == "for_s")  # said last
        return f"{self.do} {', '.join(f'{of.name} = {as_toml(getattr(self, of.name))}' for of in of_it)}"

    @property
    def failing_part(self) -> str:
        """The part of a robot that it makes fail; empty if it does not."""
        return ""

    def check(self, groups: Groups) -> None:
        """Raise BadInput, with a key within the event's table, for what does not fit these groups of robots."""
        for of in fields(self):
            if isinstance(selection := getattr(self, of.name), Selection):
                with within(of.name):
                    selection.check(groups)

    def check_radio(self, radio: Radio) -> None:
        """Raise BadInput, with a key within the event's table, for what does not fit this radio; it needs one."""
        if self.needs_signals and not radio.is_phy:
            raise BadInput("", "do", f"expected a radio with a PHY for {self.do!r}: a disk knows no strength")

    def check_bodies(self, groups: Groups, bodies: Mapping[str, Body]) -> None:  # noqa: B027 - most fit any body
        """Raise BadInput, with a key within the event's table, for what does not fit the groups' bodies, by group."""

    @abstractmethod
    def begin(self, serial: int, swarm: Swarm, conditions: ActiveEffects) -> BoolArray:
        """Change `conditions`; `serial` is the event's place in the scenario. Which robots it changed, (rows,)."""

    @property
    def evolves(self) -> bool:
        """Whether `go_on` is to be called in every tick after `begin`."""
        return False

    def go_on(self, serial: int, now_ns: int, swarm: Swarm, conditions: ActiveEffects) -> tuple[BoolArray, BoolArray]:
        """Change `conditions` as time passes; only called if it evolves.

        Returns:
            (rows,) robots for which it began, and those for which it ended.
        """
        raise TypeError(f"{self.do} does not change by itself")

    def end(self, serial: int, conditions: ActiveEffects) -> BoolArray:
        """Undo what `begin` did; only called if the event lasts for a time. Which robots that changed, (rows,)."""
        raise TypeError(f"{self.do} lasts for ever: there is nothing to undo")


@dataclass(frozen=True, kw_only=True)
class LastingEvent(Event):
    """An event that may be undone after a time: until then it holds something in the conditions, under its serial."""

    for_s: float | None = parameter(
        None, help="undone after this time; never if left out", unit="s", above=0, at_most=1e9
    )

    @property
    def lasts_s(self) -> float | None:
        """`for_s`."""
        return self.for_s

    @property
    def undoable(self) -> bool:
        """Until then it may be undone at any time."""
        return True

    @abstractmethod
    def hold(self, serial: int, swarm: Swarm, conditions: ActiveEffects) -> None:
        """Put what it holds from now on into `conditions`, under `serial`: `end` takes out all that is there."""

    @abstractmethod
    def changed(self, serial: int, conditions: ActiveEffects) -> BoolArray:
        """The robots that would be otherwise without what it holds now, (rows,)."""

    def begin(self, serial: int, swarm: Swarm, conditions: ActiveEffects) -> BoolArray:
        """Hold it."""
        self.hold(serial, swarm, conditions)
        return self.changed(serial, conditions)

    def end(self, serial: int, conditions: ActiveEffects) -> BoolArray:
        """Let go of it."""
        changed = self.changed(serial, conditions)
        conditions.let_go(serial)
        return changed


def as_toml(value: object) -> str:
    """A value of an event's table as TOML has it; what is left out of a table within stays out.

    >>> as_toml(Selection(group="flock", count=3))
    '{ group = "flock", count = 3 }'
    """
    if is_dataclass(value):
        given = {of.name: getattr(value, of.name) for of in fields(value)}
        return f"{{ {', '.join(f'{name} = {as_toml(item)}' for name, item in given.items() if item is not None)} }}"
    if isinstance(value, tuple):
        return f"[{', '.join(as_toml(item) for item in cast('tuple[object, ...]', value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f'"{value}"' if isinstance(value, str) else repr(value)


@contextmanager
def within(key: str) -> Generator[None]:
    """A fault that is found inside names its key within the table `key`."""
    try:
        yield
    except BadInput as error:
        raise BadInput("", ".".join(part for part in (key, error.key) if part), error.expected) from None
