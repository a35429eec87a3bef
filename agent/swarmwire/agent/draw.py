"""Random draws of robots, keyed by robot, tick and purpose: a draw does not depend on who else draws, or where."""

from swarmwire.comms import draws
from swarmwire.comms.arrays import FloatArray, KeyArray


class Draws:
    """Draws of n robots in one tick; a second call for a purpose gives new values."""

    def __init__(self, keys: KeyArray, tick: int, first: int = 0) -> None:
        """`first` numbers the first call for each purpose: what was drawn before it in this tick is not drawn again."""
        self._keys, self._tick, self._first = keys, tick, first
        self._calls: dict[str, int] = {}

    def uniform(self, purpose: str, low: float = 0.0, high: float = 1.0) -> FloatArray:
        """Uniform in [low, high), (n,)."""
        unit = draws.uniform(self._keys, self._tick, self._count(purpose), 0, draws.purpose(purpose))
        return low + (high - low) * unit

    def normal(self, purpose: str, mean: float = 0.0, deviation: float = 1.0) -> FloatArray:
        """Normal with this mean and standard deviation, (n,)."""
        unit = draws.normal(self._keys, self._tick, self._count(purpose), 0, draws.purpose(purpose))
        return mean + deviation * unit

    def _count(self, purpose: str) -> int:
        call = self._calls.get(purpose, self._first)
        self._calls[purpose] = call + 1
        return call


class Draw:
    """Draws of one robot in one tick; a second call for a purpose gives a new value."""

    def __init__(self, keys: KeyArray, tick: int, first: int = 0) -> None:
        self._rows = Draws(keys, tick, first)

    def uniform(self, purpose: str, low: float = 0.0, high: float = 1.0) -> float:
        """Uniform in [low, high)."""
        return float(self._rows.uniform(purpose, low, high)[0])

    def normal(self, purpose: str, mean: float = 0.0, deviation: float = 1.0) -> float:
        """Normal with this mean and standard deviation."""
        return float(self._rows.normal(purpose, mean, deviation)[0])
