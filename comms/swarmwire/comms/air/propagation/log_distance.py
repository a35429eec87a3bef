"""Log-distance: loss grows by a constant factor per decade of distance, as measured in one kind of place."""

from dataclasses import dataclass

from swarmwire.comms.air.propagation.friis import loss_at_1_m_db
from swarmwire.comms.air.propagation.loss_curve import LossCurve, straight
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True)
class LogDistance:
    """L(d) = L(1 m) + 10 n log10 d + a d dB (T. S. Rappaport, Wireless Communications, 1996; a: absorption)."""

    exponent: float = parameter(
        3.0, help="n: 2 in free space, 1.6 to 3.5 indoors, 3 to 5 in cities", above=0, at_most=20
    )
    reference_loss_db: float | None = parameter(
        None, help="loss at 1 m; without it, that of free space at the radio's frequency", unit="dB"
    )
    absorption_db_per_m: float = parameter(
        0.0, help="a: what water or leaves take per metre", unit="dB/m", at_least=0, at_most=1000
    )

    def curve(self, frequency_hz: float) -> LossCurve:
        """The loss at this frequency, which counts only where no reference loss is given."""
        reference_db = loss_at_1_m_db(frequency_hz) if self.reference_loss_db is None else self.reference_loss_db
        return straight(reference_db, 10.0 * self.exponent, self.absorption_db_per_m)
