"""Ground sensors: the shade of the floor under given points of the body."""

from dataclasses import dataclass
from math import hypot

from swarmwire.comms.parameters import parameter
from swarmwire.comms.sheets.sheet import RangedSheet


@dataclass(frozen=True)
class GroundColour(RangedSheet):
    """Sensors that look down at the floor. Sense: shade (n, points), 0 black to 1 white."""

    points_m: tuple[tuple[float, float], ...] = parameter(
        help="where each sensor looks: ahead of the body's centre, and to its left", unit="m"
    )
    noise: float = parameter(0.0, help="half width of the uniform noise", at_least=0, at_most=1)

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """As `Sheet.fault`."""
        for i, (ahead_m, left_m) in enumerate(self.points_m):
            if hypot(ahead_m, left_m) > radius_m:
                expected = f"expected a point under the body, whose radius is {radius_m:g} m; got {[ahead_m, left_m]}"
                return f"points_m[{i}]", expected
        return None
