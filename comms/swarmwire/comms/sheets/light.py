"""Light: photocells around the body."""

from dataclasses import dataclass

from swarmwire.comms.parameters import parameter
from swarmwire.comms.sheets.ring import Ring


@dataclass(frozen=True)
class Light(Ring):
    """Photocells that answer to the arena's lights. Sense: value (n, sensors), 0 dark to 1."""

    noise: float = parameter(0.0, help="half width of the uniform noise added to the response", at_least=0, at_most=1)
