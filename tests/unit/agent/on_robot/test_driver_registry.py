"""Drivers are found by entry points, by their names."""

import tomllib

import pytest

from swarmwire.agent.drivers.driver import Driver
from swarmwire.agent.on_robot.driver_registry import GROUP, driver_names, load_driver
from swarmwire.comms.errors import BadInput
from tests.release.test_workspace import ROOT


def test_those_that_come_along_are_there():
    shipped = tomllib.loads((ROOT / "agent" / "pyproject.toml").read_text("utf-8"))["project"]["entry-points"][GROUP]
    assert set(shipped) <= set(driver_names())
    for name in shipped:
        kind = load_driver(name, "robot.toml", "driver.name")
        assert issubclass(kind, Driver)
        assert f"{kind.__module__}:{kind.__name__}".startswith("swarmwire.agent.drivers.")


def test_an_unknown_one_is_refused_with_those_that_are_there():
    with pytest.raises(BadInput, match=r"robot.toml: driver.name: .*epuck2.*ros2") as refused:
        load_driver("epuck3", "robot.toml", "driver.name")
    assert "epuck3" in str(refused.value)
