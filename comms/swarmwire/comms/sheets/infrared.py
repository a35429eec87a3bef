"""Passive infrared: a sensor with its own light off, which sees the light of other robots alone."""

from dataclasses import dataclass

from swarmwire.comms.sheets.rim import Rim


@dataclass(frozen=True)
class Infrared(Rim):
    """Rays from the body's rim that answer to the nearest robot on them, unless an obstacle hides it; not to walls.

    Beside proximity, which sees both, it tells robots from walls. Sense: value (n, rays), 0 to 1.
    """
