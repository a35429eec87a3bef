"""Engines: what moves bodies, by the name that a scenario gives in [physics]."""

import sys

from swarmwire.deploy.catalogue.docs import first_line
from swarmwire.deploy.catalogue.entry import Entry
from swarmwire.world.engines.physics import ENGINES

AUTO = "discs, or pymunk where an obstacle is movable; robots that fly or have no contacts are kinematic"


def engines() -> list[Entry]:
    """What a scenario may name: the choice between engines, then each of them."""
    told = {name: sys.modules[kind.__module__].__doc__ for name, kind in ENGINES.items()}
    return [_engine("auto", AUTO), *(_engine(name, first_line(of)) for name, of in told.items())]


def _engine(name: str, told: str) -> Entry:
    return Entry("engine", name, told, (("in a scenario", f'engine = "{name}" in [physics]'),))
