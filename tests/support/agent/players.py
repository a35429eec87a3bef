"""Agents for tests, each for one service of a host."""

from typing import ClassVar

import numpy as np

from swarmwire.agent import Agent, FloatColumn, IntColumn, Memory, Message, Robot, Robots, VectorAgent, column, f4, i2


class Word(Message):
    number: f4


class Other(Message):
    number: i2


class Chatter(Agent):
    """Uses sensors, draws, packets of each kind, addresses, commands, LEDs, and notes in some ticks."""

    needs = ("proximity", "compass", "radio.range", "radio.bearing")
    gain: float = 0.5

    def __init__(self) -> None:
        self.total = 0.0

    def step(self, robot: Robot) -> None:
        for packet in robot.radio.received(Word):
            self.total += packet.message.number * packet.range_m + packet.bearing_rad + packet.sender
        for packet in robot.radio.received(dict):
            self.total += float(packet.message["x"])
        if robot.draw.uniform("whether") < 0.7:
            robot.drive(self.gain * self.total, robot.compass.heading_rad + robot.proximity.value.sum())
        robot.led(0.0, robot.draw.uniform("green"), 0.0, index=round(10.0 * robot.time_s) % 8)
        if robot.draw.uniform("note") < 0.5:
            robot.note("driven" if self.total > 0.0 else "idle", value=self.total)
        robot.radio.send(Word(number=robot.draw.normal("word")))
        robot.radio.send({"x": robot.time_s}, to=0)
        robot.radio.send(Other(number=7), to=1)


class Echo(Agent):
    """Sends a word in each step, and for each word that it receives between steps, with the number so far."""

    def __init__(self) -> None:
        self.heard = 0

    def step(self, robot: Robot) -> None:
        self.heard += 100 * len(robot.radio.received(Word))
        robot.radio.send(Word(number=float(self.heard)))

    def on_receive(self, robot: Robot) -> None:
        for _ in robot.radio.received(Word):
            self.heard += 1
            robot.radio.send(Word(number=float(self.heard)))


class Heard(Memory):
    heard: IntColumn = column(0)


class VectorEcho(VectorAgent[Heard]):
    """The same for n robots, one word for all that are received at a time."""

    def step(self, robots: Robots, memory: Heard) -> None:
        memory.heard += 100 * robots.radio.received(Word).count()
        robots.radio.send(Word, number=memory.heard)

    def on_receive(self, robots: Robots, memory: Heard) -> None:
        received = robots.radio.received(Word).count()
        memory.heard += received
        robots.radio.send(Word, rows=received > 0, number=memory.heard)


class Insisting(Agent):
    """Sends a number to its neighbour until it is acknowledged, then the next; its speed depends on all tx_status."""

    needs = ("radio.tx_status",)

    def __init__(self) -> None:
        self.number, self.waits_for, self.digest = 0, -1, 0

    def step(self, robot: Robot) -> None:
        for tx_status in robot.radio.tx_status:
            self.digest = 7 * self.digest + tx_status.id + 100 * tx_status.result
            self.digest %= 10_007
            self.number += tx_status.acknowledged
            if tx_status.id == self.waits_for:
                self.waits_for = -1
        if self.waits_for < 0:
            robot.radio.send(Other(number=-1))
            self.waits_for = robot.radio.send(Other(number=self.number), to=0)
        robot.drive(1e-5 * self.digest, 1e-3 * self.number)


class Insistence(Memory):
    number: IntColumn = column(0)
    waits_for: IntColumn = column(-1)
    digest: IntColumn = column(0)


class VectorInsisting(VectorAgent[Insistence]):
    """The same for n robots."""

    needs: ClassVar[tuple[str, ...]] = ("radio.tx_status",)

    def step(self, robots: Robots, memory: Insistence) -> None:
        tx_status = robots.radio.tx_status
        for at, row in enumerate(tx_status.row.tolist()):
            digest = 7 * memory.digest[row] + tx_status.id[at] + 100 * tx_status.result[at]
            memory.digest[row] = digest % 10_007
        memory.number += np.bincount(tx_status.row[tx_status.acknowledged], minlength=robots.n)
        memory.waits_for[tx_status.row[tx_status.id == memory.waits_for[tx_status.row]]] = -1
        again = memory.waits_for < 0
        robots.radio.send(Other, rows=again, number=-1.0)
        memory.waits_for[again] = robots.radio.send(Other, rows=again, to=0, number=memory.number.astype(float))
        robots.drive(1e-5 * memory.digest, 1e-3 * memory.number)


class Counter(Agent):
    """Drives as many m/s as it has made steps."""

    def __init__(self) -> None:
        self.steps = 0

    def __len__(self) -> int:
        return 0  # an empty container is still an agent

    def step(self, robot: Robot) -> None:
        self.steps += 1
        robot.drive(float(self.steps), 0.0)


class Steps(Memory):
    steps: IntColumn = column(0)


class VectorCounter(VectorAgent[Steps]):
    def step(self, robots: Robots, memory: Steps) -> None:
        memory.steps += 1
        robots.drive(memory.steps, 0.0)


class Failing(Agent):
    """Reads a sense that it did not declare, in tick 2 as the robot whose compass shows more than 0."""

    needs = ("compass",)

    def step(self, robot: Robot) -> None:
        if robot.time_s > 0.15 and robot.compass.heading_rad > 0.0:
            print(robot.proximity)


class Unmade(Agent):
    """Cannot be made."""

    def __init__(self) -> None:
        raise RuntimeError("no memory left")

    def step(self, robot: Robot) -> None: ...


class Stateless(Agent):
    def step(self, robot: Robot) -> None: ...


class Parametrised(Agent):
    """Has a parameter of each type, and sees them when it is made."""

    speed_mps: float
    count: int = 3
    eager: bool = False
    word: str = "hop"
    needs: ClassVar[tuple[str, ...]] = ()

    def __init__(self) -> None:
        self.seen = (self.speed_mps, self.count, self.eager, self.word)

    def step(self, robot: Robot) -> None: ...


class Means(VectorAgent):
    """Cheats: every robot knows the mean heading of all."""

    needs: ClassVar[tuple[str, ...]] = ("compass",)

    def step(self, robots: Robots, memory: Memory) -> None:
        heading = robots.compass.heading_rad
        robots.drive(0.1, heading.mean() if len(heading) else 0.0)


class Neighbour(VectorAgent):
    """Cheats: every robot knows the heading of the next row."""

    needs: ClassVar[tuple[str, ...]] = ("compass",)

    def step(self, robots: Robots, memory: Memory) -> None:
        robots.drive(0.1, np.roll(robots.compass.heading_rad, 1))


class Crowd(VectorAgent):
    """Cheats: every robot knows how many there are."""

    def step(self, robots: Robots, memory: Memory) -> None:
        robots.drive(0.01 * robots.n, 0.0)


class Remembering(VectorAgent):
    """Cheats: keeps on itself what belongs into its Memory."""

    needs: ClassVar[tuple[str, ...]] = ("compass",)

    def __init__(self) -> None:
        self.last: dict[int, FloatColumn] = {}  # number of robots: headings

    def step(self, robots: Robots, memory: Memory) -> None:
        robots.drive(0.1, self.last.get(robots.n, 0.0))
        self.last[robots.n] = robots.compass.heading_rad


class Ageing(VectorAgent):
    """Cheats: counts on itself, for all robots, how often it was called."""

    def __init__(self) -> None:
        self.calls = [0]

    def step(self, robots: Robots, memory: Memory) -> None:
        self.calls[0] += 1
        robots.drive(float(self.calls[0]), 0.0)


class Reply(VectorAgent):
    """Cheats: sends what its neighbours' rows received."""

    def step(self, robots: Robots, memory: Memory) -> None:
        received = robots.radio.received(Word)
        robots.radio.send(Word, number=float(len(received)))


class Table(Memory):
    x: FloatColumn = column(0.5)
    n: IntColumn = column(-1)
