"""What a scenario says of measured links. No kernels here: a scenario is read without a compiler."""

from dataclasses import dataclass

from swarmwire.comms.parameters import parameter


@dataclass(frozen=True)
class Trace:
    """Measured links that are replayed: a value holds until the next of its link (sender and receiver)."""

    file: str = parameter(
        help="CSV or Parquet beside the scenario: t_s, tx, rx, and delivery_ratio, rssi_dbm or delay_s, or several"
    )
    others: str = parameter(
        "none",
        help="what links without a value yet are: none, out of range; or as the model has them",
        choices=("none", "model"),
    )
