"""Readings that a body's sensors may tell, made up by hypothesis."""

from collections.abc import Callable
from math import inf, pi

import numpy as np
from hypothesis import strategies as st

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.sensors.light import LightSpec
from swarmwire.comms.sensors.rays import ProximitySpec
from swarmwire.comms.sensors.scan import ScanSpec
from swarmwire.comms.sensors.simple import BatterySpec, GroundSpec
from tests.support.robots.rig import Fields

_SHARE = st.floats(0.0, 1.0)


def readings(body: Body, readings: frozenset[str]) -> st.SearchStrategy[Fields]:
    """Fields of these sensors, (1,) or (1, width) each; not of odometry, which cannot jump."""
    made = [_OF[name](body) for name in sorted(readings) if name in _OF]
    return st.tuples(*made).map(lambda parts: {name: value for part in parts for name, value in part.items()})


def _wide(name: str, width: int, of: st.SearchStrategy[float]) -> st.SearchStrategy[Fields]:
    return st.lists(of, min_size=width, max_size=width).map(lambda values: {name: np.array([values])})


def _numbers(**of: st.SearchStrategy[float]) -> st.SearchStrategy[Fields]:
    return st.fixed_dictionaries(of).map(
        lambda values: {name.replace("__", "."): np.array([value]) for name, value in values.items()}
    )


def _proximity(body: Body) -> st.SearchStrategy[Fields]:
    sheet = body.sensors["proximity"]
    assert isinstance(sheet, ProximitySpec)
    return _wide("proximity.value", len(sheet.angles_deg), _SHARE)


def _light(body: Body) -> st.SearchStrategy[Fields]:
    sheet = body.sensors["light"]
    assert isinstance(sheet, LightSpec)
    return _wide("light.value", len(sheet.angles_deg), _SHARE)


def _ground(body: Body) -> st.SearchStrategy[Fields]:
    sheet = body.sensors["ground"]
    assert isinstance(sheet, GroundSpec)
    return _wide("ground.shade", len(sheet.points_m), _SHARE)


def _scan(body: Body) -> st.SearchStrategy[Fields]:
    sheet = body.sensors["scan"]
    assert isinstance(sheet, ScanSpec)
    ranges = st.one_of(st.floats(sheet.range_min_m, 0.999 * sheet.range_m), st.just(inf))
    return _wide("scan.range_m", sheet.rays, ranges)


def _imu(body: Body) -> st.SearchStrategy[Fields]:
    acceleration, turn = st.floats(-30.0, 30.0), st.floats(-6.0, 6.0)
    return _numbers(imu__forward_mps2=acceleration, imu__left_mps2=acceleration, imu__turn_radps=turn)


def _battery(body: Body) -> st.SearchStrategy[Fields]:
    sheet = body.sensors["battery"]
    assert isinstance(sheet, BatterySpec)

    def fields(charge: float) -> Fields:
        voltage_v = sheet.empty_v + charge * (sheet.full_v - sheet.empty_v)
        return {"battery.charge": np.array([charge]), "battery.voltage_v": np.array([voltage_v])}

    return _SHARE.map(fields)


_OF: dict[str, Callable[[Body], st.SearchStrategy[Fields]]] = {
    "proximity": _proximity,
    "light": _light,
    "ground": _ground,
    "scan": _scan,
    "imu": _imu,
    "compass": lambda _: _numbers(compass__heading_rad=st.floats(-pi, pi)),
    "battery": _battery,
}
