"""A client of an e-puck2 over Wi-Fi, real or emulated, with Python's own modules alone; docs/epuck2.md explains it.

    swarmwire run scenarios/robots/avoidance-epuck2.toml --gateway epuck2@127.0.0.1:11000
    python examples/epuck2_client.py 127.0.0.1 11000

It drives a curve for two seconds with the front LED on, prints the distance ahead, and saves the last image.
"""

import select
import socket
import struct
import sys
import time
from pathlib import Path

COMMAND = struct.Struct("<BBBhhB12sB")
HEADER, FRONT_LED = 0x80, 0b100000
NOTHING, IMAGE, SENSORS = 0, 1, 2  # to ask for
EMPTY = 3  # the answer to nothing
SIZES = {IMAGE: 160 * 120 * 2, SENSORS: 104, EMPTY: 0}


def send(robot: socket.socket, left: int, right: int, leds: int, request: int) -> None:
    """A command: speeds in steps/s, LEDs of one colour, and the parts of the answer."""
    robot.sendall(COMMAND.pack(HEADER, request, 0, left, right, leds, bytes(12), 0))


def read(robot: socket.socket, size: int) -> bytes:
    """So many bytes, which may come in pieces."""
    data = b""
    while len(data) < size:
        more = robot.recv(size - len(data))
        if not more:
            raise ConnectionError("the robot hung up")
        data += more
    return data


def read_part(robot: socket.socket) -> tuple[int, bytes]:
    """The next part of an answer: what it is, and its content."""
    part = read(robot, 1)[0]
    return part, read(robot, SIZES[part])


def save(image: bytes, path: str) -> None:
    """Save an image as a PPM file: five bits of red, six of green and five of blue become eight each."""
    pixels = struct.unpack(">19200H", image)
    colours = bytes(c for p in pixels for c in (p >> 8 & 0xF8, p >> 3 & 0xFC, p << 3 & 0xF8))
    Path(path).write_bytes(b"P6 160 120 255\n" + colours)


def main(host: str, port: int) -> None:
    newest: dict[int, bytes] = {}
    with socket.create_connection((host, port)) as robot:
        for _ in range(20):
            send(robot, 300, 250, FRONT_LED, IMAGE | SENSORS)
            time.sleep(0.1)  # noqa: TID251 - a client without swarmwire has none of its clocks
            while select.select([robot], [], [], 0)[0]:  # all that has arrived
                part, content = read_part(robot)
                newest[part] = content
            if SENSORS in newest:
                (distance_mm,) = struct.unpack_from("<H", newest[SENSORS], 69)
                print(f"distance ahead: {distance_mm} mm")
        send(robot, 0, 0, 0, NOTHING)  # it would drive on
        while read_part(robot)[0] != EMPTY:  # a connection that closes with unread answers may lose the command
            pass
    save(newest[IMAGE], "image.ppm")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
