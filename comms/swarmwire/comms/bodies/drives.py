"""Drives: what moves a body and how fast it can go, as tables of its data sheet; `kind` says which."""

from dataclasses import dataclass

from swarmwire.comms.parameters import parameter


@dataclass(frozen=True)
class WheelNoise:
    """How wheels differ from what they are asked for: asked for w, a wheel runs at f (w + b), as ARGoS has it.

    The bias b is drawn once for each wheel, the factor f for each wheel in each tick, both normal. Where both
    wheels are asked to stand still they do.
    """

    bias_mps: float = parameter(0.0, help="mean of the bias b", unit="m/s", at_least=-0.1, at_most=0.1)
    bias_std_mps: float = parameter(0.0, help="standard deviation of the bias b", unit="m/s", at_least=0, at_most=0.1)
    factor: float = parameter(1.0, help="mean of the factor f", at_least=0, at_most=2)
    factor_std: float = parameter(0.0, help="standard deviation of the factor f", at_least=0, at_most=0.5)


NO_WHEEL_NOISE = WheelNoise()  # wheels do as they are told


@dataclass(frozen=True)
class Wheels:
    """Two wheels on one axle; a command that a wheel cannot follow is slowed down as a whole, so its curve stays."""

    wheel_base_m: float = parameter(help="distance between the wheels", unit="m", above=0)
    max_wheel_mps: float = parameter(help="fastest speed of a wheel", unit="m/s", above=0)
    max_force_n: float = parameter(help="largest force along the body, or across it before it slips", unit="N", above=0)
    max_torque_nm: float = parameter(help="largest turning moment", unit="N m", above=0)
    noise: WheelNoise = parameter(NO_WHEEL_NOISE, help="how the wheels differ from what they are asked for")
    kind: str = parameter("wheels", help="kind of drive", choices=("wheels",))

    @property
    def max_linear_mps(self) -> float:
        """The fastest it can drive straight ahead."""
        return self.max_wheel_mps

    @property
    def max_angular_radps(self) -> float:
        """The fastest it can turn on the spot."""
        return 2.0 * self.max_wheel_mps / self.wheel_base_m


@dataclass(frozen=True)
class Twist:
    """Two wheels on one axle behind a controller that limits forward speed and turn rate apart."""

    wheel_base_m: float = parameter(help="distance between the wheels", unit="m", above=0)
    max_linear_mps: float = parameter(help="fastest forward speed", unit="m/s", above=0)
    max_angular_radps: float = parameter(help="fastest turn", unit="rad/s", above=0)
    max_force_n: float = parameter(help="largest force along the body, or across it before it slips", unit="N", above=0)
    max_torque_nm: float = parameter(help="largest turning moment", unit="N m", above=0)
    noise: WheelNoise = parameter(NO_WHEEL_NOISE, help="how the wheels differ from what they are asked for")
    kind: str = parameter("twist", help="kind of drive", choices=("twist",))


@dataclass(frozen=True)
class Holonomic:
    """Moves in every direction of the plane and turns at the same time; it has no wheels that slip, and no noise."""

    max_speed_mps: float = parameter(help="fastest speed in any direction of the plane", unit="m/s", above=0)
    max_angular_radps: float = parameter(help="fastest turn", unit="rad/s", above=0)
    max_force_n: float = parameter(help="largest force in any direction of the plane", unit="N", above=0)
    max_torque_nm: float = parameter(help="largest turning moment", unit="N m", above=0)
    kind: str = parameter("holonomic", help="kind of drive", choices=("holonomic",))

    @property
    def max_linear_mps(self) -> float:
        """The fastest it can move straight ahead."""
        return self.max_speed_mps


Drive = Wheels | Twist | Holonomic  # what a body has one of
# By `kind` in a body's sheet.
DRIVES: dict[str, type[Drive]] = {"wheels": Wheels, "twist": Twist, "holonomic": Holonomic}


def wheel_base_of(drive: Drive) -> float:
    """The distance between a drive's wheels in m; 0 if it has none."""
    return 0.0 if isinstance(drive, Holonomic) else drive.wheel_base_m
