"""The base classes of events: frozen dataclasses of parameters with methods to check, begin and end the event."""

from abc import ABC, abstractmethod
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from typing import ClassVar, cast

from swarmwire.comms.base.arrays import BoolArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.world.events.effects import ActiveEffects
from swarmwire.world.events.selection import Groups, Selection, Swarm


@dataclass(frozen=True, kw_only=True)
class Event(ABC):
    """A change to the robots of every arena at a time of the run.

    It takes effect at the first tick that starts at `at_s` or later; an event after the end of the run never does. It
    changes `ActiveEffects`, which world and radio medium read, and so depends on neither.
    """

    at_s: float = parameter(help="when it happens", unit="s", at_least=0, at_most=1e9)
    do: str = parameter(help="kind of event")
    needs_radio: ClassVar[bool] = False
    needs_phy: ClassVar[bool] = False  # the unit disk has no signal strengths

    @property
    def duration_s(self) -> float | None:
        """Time until it is undone; None: permanent."""
        return None

    @property
    def undoable(self) -> bool:
        """True if its duration or a user can undo it; False for a momentary event."""
        return False

    @property
    def words(self) -> str:
        """Text of the event in a scenario: the action, and the keys that differ from their defaults."""
        shown = [
            field
            for field in fields(self)
            if field.name not in ("at_s", "do") and getattr(self, field.name) != field.default
        ]
        shown.sort(key=lambda field: field.name == "for_s")  # last
        return f"{self.do} {', '.join(f'{field.name} = {as_toml(getattr(self, field.name))}' for field in shown)}"

    @property
    def failing_part(self) -> str:
        """Part of a robot that fails by the event; "" if none does."""
        return ""

    def check(self, groups: Groups) -> None:
        """Raise BadInput, with a key within the event's table, for values that do not fit these groups of robots."""
        for field in fields(self):
            if isinstance(selection := getattr(self, field.name), Selection):
                with within(field.name):
                    selection.check(groups)

    def check_radio(self, radio: Radio) -> None:
        """Raise BadInput, with a key within the event's table, for values that do not fit this radio."""
        if self.needs_phy and not radio.is_phy:
            raise BadInput("", "do", f"expected a radio with a PHY for {self.do!r}; a unit disk has no power")

    def check_bodies(self, groups: Groups, bodies: Mapping[str, Body]) -> None:  # noqa: B027 - most fit any body
        """Raise BadInput, with a key within the event's table, for values that do not fit the bodies, by group."""

    @abstractmethod
    def begin(self, serial: int, swarm: Swarm, effects: ActiveEffects) -> BoolArray:
        """Change `effects`; `serial` is the event's index in the scenario. Return the changed robots, (rows,)."""

    @property
    def evolves(self) -> bool:
        """True if `advance` must be called in every tick after `begin`."""
        return False

    def advance(self, serial: int, now_ns: int, swarm: Swarm, effects: ActiveEffects) -> tuple[BoolArray, BoolArray]:
        """Change `effects` as time passes; only called if the event evolves.

        Returns:
            Robots for which the event began, (rows,), and robots for which it ended, (rows,).
        """
        raise TypeError(f"{self.do} does not change over time")

    def end(self, serial: int, effects: ActiveEffects) -> BoolArray:
        """Undo `begin`; only called if the event lasts for a time. Return the changed robots, (rows,)."""
        raise TypeError(f"{self.do} is permanent and cannot be undone")


@dataclass(frozen=True, kw_only=True)
class LastingEvent(Event):
    """An event that can be undone; until then its effects are in `ActiveEffects`, under its serial."""

    for_s: float | None = parameter(
        None, help="undone after this time; permanent if omitted", unit="s", above=0, at_most=1e9
    )

    @property
    def duration_s(self) -> float | None:
        """`for_s`."""
        return self.for_s

    @property
    def undoable(self) -> bool:
        """True: a user can undo it early."""
        return True

    @abstractmethod
    def apply(self, serial: int, swarm: Swarm, effects: ActiveEffects) -> None:
        """Add the event's effects to `effects`, under `serial`; `end` removes them all."""

    @abstractmethod
    def changed(self, serial: int, effects: ActiveEffects) -> BoolArray:
        """True for robots that only this event changes at present, (rows,)."""

    def begin(self, serial: int, swarm: Swarm, effects: ActiveEffects) -> BoolArray:
        """Add the event's effects."""
        self.apply(serial, swarm, effects)
        return self.changed(serial, effects)

    def end(self, serial: int, effects: ActiveEffects) -> BoolArray:
        """Remove the event's effects."""
        changed = self.changed(serial, effects)
        effects.release(serial)
        return changed


def as_toml(value: object) -> str:
    """Format a value of an event's table as TOML; an inner table omits keys that are None.

    >>> as_toml(Selection(group="flock", count=3))
    '{ group = "flock", count = 3 }'
    """
    if is_dataclass(value):
        items = {field.name: getattr(value, field.name) for field in fields(value)}
        return f"{{ {', '.join(f'{name} = {as_toml(item)}' for name, item in items.items() if item is not None)} }}"
    if isinstance(value, tuple):
        return f"[{', '.join(as_toml(item) for item in cast('tuple[object, ...]', value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f'"{value}"' if isinstance(value, str) else repr(value)


@contextmanager
def within(key: str) -> Generator[None]:
    """Prefix the keys of BadInput errors with the table `key`."""
    try:
        yield
    except BadInput as error:
        raise BadInput("", ".".join(part for part in (key, error.key) if part), error.expected) from None
