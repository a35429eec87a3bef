"""The packets of the e-puck2: sizes, headers, and the layout of its sensors; all little-endian."""

from enum import IntFlag

import numpy as np

from swarmwire.comms.config import ExplainedEnum

PORT = 1000  # of TCP, on the robot
COMMAND_BYTES = 21
COMMAND_HEADER = 0x80


class Header(ExplainedEnum):
    """What the first byte of an answer announces."""

    IMAGE = 1, "an image, 160 x 120 points of 2 bytes"
    SENSORS = 2, "the sensors"
    EMPTY = 3, "nothing: the command asked for nothing"


class PacketRequest(IntFlag):
    """What a command asks for; the image is answered first."""

    NOTHING = 0
    IMAGE = 1
    SENSORS = 2


class RobotSettingsBits(IntFlag):
    """The flags of a command, beside speeds and lights."""

    NONE = 0
    CALIBRATE = 1  # of the proximity sensors: takes a second, with nothing near
    AVOID = 2  # the robot steers commands away from obstacles
    SET_STEPS = 4  # the two numbers are what the step counters are to show, not speeds


# The answer to a command that asks for the sensors.
SENSORS = np.dtype(
    [
        ("acceleration", "<i2", 3),  # about 800 = 1 g: to the left, ahead, up
        ("acceleration_size", "<f4"),  # in the same unit
        ("orientation_deg", "<f4"),  # to where it leans: 0 ahead, 90 to the left
        ("inclination_deg", "<f4"),  # 0 upright
        ("gyro", "<i2", 3),  # 32768 = 250 degrees/s; the last one is positive to the left
        ("magnetic_field", "<f4", 3),  # in the magnetometer's own axes
        ("temperature_c", "i1"),
        ("proximity", "<u2", 8),  # reflected light above that of the calibration; higher is nearer
        ("ambient", "<u2", 8),  # about 4000 is dark, less is brighter
        ("distance_mm", "<u2"),  # of the time-of-flight sensor; 8190 and more: it sees nothing
        ("microphones", "<u2", 4),
        ("steps", "<i2", 2),  # left and right; they wrap
        ("battery", "<u2"),
        ("memory_card", "u1"),
        ("remote_control", "u1", 3),  # toggle, address, data
        ("selector", "u1"),
        ("ground", "<u2", 3),  # reflected light: 0 black to about 1000 white; left, middle, right
        ("ground_ambient", "<u2", 3),
        ("button", "u1"),
        ("reserved", "u1"),
    ]
)
# Bytes of an answer, behind its first one.
PAYLOAD_BYTES = {Header.IMAGE: 160 * 120 * 2, Header.SENSORS: SENSORS.itemsize, Header.EMPTY: 0}
