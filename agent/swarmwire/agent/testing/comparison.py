"""Comparison: two agents that are given the same, and where what they do comes apart."""

from dataclasses import dataclass

from swarmwire.agent.testing.deeds import deeds
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.tick_io import Actions

MOST_SHOWN = 8  # deeds of a robot


@dataclass(frozen=True)
class Comparison:
    """Who is compared, and what is said if they differ."""

    text: str
    names: tuple[str, str]
    body: Body

    def check(self, tick: int, first: Actions, second: Actions) -> None:
        """AssertionError with the first robot that does not do the same in both, and what it does in each."""
        one, other = deeds(first, self.body), deeds(second, self.body)
        different = [robot for robot in one if one[robot] != other[robot]]
        if different:
            robot, *others = different
            lines = [f"{self.text} in tick {tick}, robot {robot}:", *self._lines(one[robot], other[robot])]
            if others:
                lines.append(f"and so do robots {', '.join(map(str, others))}")
            raise AssertionError("\n".join(lines))

    def _lines(self, one: dict[str, str], other: dict[str, str]) -> list[str]:
        first, second = self.names
        apart = [what for what in one | other if one.get(what) != other.get(what)]
        lines = [
            f"  {what}: {one.get(what, 'nothing')} ({first}), {other.get(what, 'nothing')} ({second})"
            for what in apart[:MOST_SHOWN]
        ]
        return lines + [f"  and {len(apart) - MOST_SHOWN} more"] * (len(apart) > MOST_SHOWN)
