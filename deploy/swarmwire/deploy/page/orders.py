"""What the page may be asked to do: each order is checked, and says how the run is asked for it."""

from abc import ABC, abstractmethod
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from swarmwire.deploy.control.remote_control import RemoteControl

MAX_STEPS = 100_000


class _Order(BaseModel, ABC):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @abstractmethod
    def give(self, control: RemoteControl) -> int | None:
        """Ask the run for it; the number of the event that it began, if any."""


class Pause(_Order):
    """No tick begins until `resume` or `step`."""

    do: Literal["pause"]

    def give(self, control: RemoteControl) -> None:
        """Pause."""
        control.pause()


class Resume(_Order):
    """The run goes on."""

    do: Literal["resume"]

    def give(self, control: RemoteControl) -> None:
        """Go on."""
        control.resume()


class Step(_Order):
    """So many ticks, then the run pauses."""

    do: Literal["step"]
    n: int = Field(1, ge=1, le=MAX_STEPS)

    def give(self, control: RemoteControl) -> None:
        """Step."""
        control.step(self.n)


class Speed(_Order):
    """At most so many simulated seconds per second of wall time; None: as fast as possible."""

    do: Literal["speed"]
    factor: float | None = Field(gt=0, le=1e6)

    def give(self, control: RemoteControl) -> None:
        """Set it."""
        control.speed(self.factor)


class Stop(_Order):
    """The run ends."""

    do: Literal["stop"]

    def give(self, control: RemoteControl) -> None:
        """End it."""
        control.stop()


class Happen(_Order):
    """Something happens: a scenario's event without `at_s`, which the run itself checks."""

    do: Literal["event"]
    event: dict[str, Any]

    def give(self, control: RemoteControl) -> int:
        """Let it happen."""
        return control.event(self.event)


class End(_Order):
    """Something that lasts is over."""

    do: Literal["end"]
    number: int = Field(ge=0)

    def give(self, control: RemoteControl) -> None:
        """End it."""
        control.end(self.number)


Order = Annotated[Pause | Resume | Step | Speed | Stop | Happen | End, Field(discriminator="do")]
