"""The sensors' packet as readings of the senses in a body's sheet."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import AnyArray, FloatArray
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.robots.epuck2 import units
from swarmwire.comms.robots.epuck2.magnetometer import Compass
from swarmwire.comms.robots.epuck2.odometer import Odometer
from swarmwire.comms.robots.epuck2.wheels import M_PER_STEP
from swarmwire.comms.sheets import Battery

Fields = dict[str, FloatArray]  # "sense.field" -> (1,) or (1, width)


@dataclass(frozen=True, slots=True)
class Calibration:
    """What differs from robot to robot."""

    compass: Compass
    turn_offset_radps: float = 0.0
    ground_black: float = units.GROUND_BLACK
    ground_white: float = units.GROUND_WHITE


class Readings:
    """The senses of one robot, from its packets and the steps that it has gone."""

    def __init__(self, body: Body, calibration: Calibration, odometer: Odometer) -> None:
        self._body, self._calibration, self._odometer = body, calibration, odometer
        self._of: dict[str, Callable[[AnyArray], Fields]] = {
            "proximity": lambda told: {"proximity.value": units.proximity(told["proximity"])},
            "light": lambda told: {"light.value": units.light(told["ambient"])},
            "ground": self._ground,
            "scan": self._scan,
            "odometry": self._odometry,
            "imu": self._imu,
            "compass": lambda told: {"compass.heading_rad": calibration.compass.heading_rad(told["magnetic_field"])},
            "battery": self._battery,
        }

    def of(self, told: AnyArray, senses: frozenset[str]) -> Fields:
        """The readings of these senses in a packet, `SENSORS` (1,)."""
        fields: Fields = {}
        for name in senses:
            fields |= self._of[name](told)
        return fields

    def _ground(self, told: AnyArray) -> Fields:
        of = self._calibration
        return {"ground.shade": units.shade(told["ground"], of.ground_black, of.ground_white)}

    def _scan(self, told: AnyArray) -> Fields:
        sheet = self._body.scan
        assert sheet is not None
        return {"scan.range_m": units.distance_m(told["distance_mm"], sheet)[:, None]}

    def _odometry(self, told: AnyArray) -> Fields:
        steps = self._odometer.left, self._odometer.right
        left_m, right_m = (np.array([M_PER_STEP * wheel]) for wheel in steps)
        return {"odometry.left_m": left_m, "odometry.right_m": right_m}

    def _imu(self, told: AnyArray) -> Fields:
        # The accelerometer's first axis is to the left and its second ahead: GCtronic's driver swaps them, too.
        acceleration, turn = told["acceleration"] / units.PER_MPS2, told["gyro"][:, 2] / units.PER_RADPS
        return {
            "imu.forward_mps2": acceleration[:, 1].copy(),
            "imu.left_mps2": acceleration[:, 0].copy(),
            "imu.turn_radps": turn - self._calibration.turn_offset_radps,
        }

    def _battery(self, told: AnyArray) -> Fields:
        sheet = self._body.senses["battery"]
        assert isinstance(sheet, Battery)
        voltage_v = told["battery"] / units.PER_V
        return {"battery.charge": units.charge(voltage_v, sheet), "battery.voltage_v": voltage_v}
