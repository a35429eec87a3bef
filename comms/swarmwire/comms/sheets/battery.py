"""The battery: what it holds, and what drains it."""

from dataclasses import dataclass

from swarmwire.comms.parameters import parameter
from swarmwire.comms.sheets.sheet import Sheet


@dataclass(frozen=True)
class Battery(Sheet):
    """What the robot runs on; when it is empty, the robot is dead. Sense: charge (n,), 0 to 1, and voltage_v (n,).

    It gives `idle_w`, `drive_w_per_mps` times the mean speed at which the wheels are told to run (of a body without
    wheels, the speed in the plane), and `led_w` for each LED that is lit. The voltage falls evenly with the charge.
    """

    capacity_wh: float = parameter(help="energy of a full battery", unit="Wh", above=0)
    idle_w: float = parameter(0.0, help="power that is always drawn", unit="W", at_least=0)
    drive_w_per_mps: float = parameter(0.0, help="power drawn for each m/s of the wheels", unit="W s/m", at_least=0)
    led_w: float = parameter(0.0, help="power drawn by an LED that is lit", unit="W", at_least=0)
    start: float = parameter(1.0, help="charge at the start of a run, as a share", at_least=0, at_most=1)
    full_v: float = parameter(4.2, help="voltage when full; of one lithium cell, if left out", unit="V", above=0)
    empty_v: float = parameter(3.4, help="voltage when empty; of one lithium cell, if left out", unit="V", at_least=0)
    noise: float = parameter(0.0, help="standard deviation of the charge's error", at_least=0, at_most=1)
    noise_v: float = parameter(0.0, help="standard deviation of the voltage's error", unit="V", at_least=0)

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """As `Sheet.fault`."""
        if self.empty_v > self.full_v:
            return "empty_v", f"expected at most full_v, {self.full_v:g} V; got {self.empty_v!r}"
        return None
