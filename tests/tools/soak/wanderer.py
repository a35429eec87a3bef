"""The agent of a soak, whose path depends on memory, draws and packets, so that lost or repeated ticks show."""

from swarmwire.agent import FloatColumn, IntColumn, Memory, Message, Robots, VectorAgent, column, f4


class Word(Message):
    """Number of steps of the sender."""

    number: f4


class Walked(Memory):
    """All that the next runner of a robot needs."""

    steps: IntColumn = column(0)
    received: FloatColumn = column(0.0)


class Wanderer(VectorAgent[Walked]):
    """Drives on a way that follows from every step made, every word received and every draw."""

    def step(self, robots: Robots, memory: Walked) -> None:
        """Count, listen, tell, drive."""
        memory.steps += 1
        words = robots.radio.received(Word)
        memory.received += words.sum(words.message.number)
        robots.radio.send(Word, number=memory.steps)
        turn = robots.draw.uniform("turn") - 0.5
        robots.drive(0.02 + 0.0001 * (memory.steps % 50), turn + 0.001 * (memory.received % 100))
