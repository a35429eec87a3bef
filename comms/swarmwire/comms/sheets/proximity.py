"""Proximity: active infrared, which sees its own light come back from robots, obstacles and walls."""

from dataclasses import dataclass

from swarmwire.comms.sheets.rim import Rim


@dataclass(frozen=True)
class Proximity(Rim):
    """Rays from the body's rim that answer to the nearest thing on them. Sense: value (n, rays), 0 to 1."""
