"""What a scenario says of access to the medium. No kernels here: a scenario is read without a compiler."""

from dataclasses import dataclass

from swarmwire.comms.parameters import parameter

METHODS = ("none", "aloha", "csma-802154", "dcf")


@dataclass(frozen=True)
class Access:
    """When a radio may send, and whether frames that overlap disturb one another."""

    method: str = parameter(
        "none",
        help="none: frames never disturb one another; aloha: they do, and radios send at once; csma-802154: "
        "unslotted CSMA/CA; dcf: that of IEEE 802.11",
        choices=METHODS,
    )
    acknowledged: bool = parameter(
        True, help="of csma-802154 and dcf: addressed packets are acknowledged, and sent again if that fails"
    )
    busy_dbm: float | None = parameter(
        None,
        help="power from which the air counts as busy; without it 10 dB above the sensitivity (csma-802154) or "
        "-62 dBm (dcf)",
        unit="dBm",
        at_least=-200,
        at_most=100,
    )
    most_retries: int | None = parameter(
        None,
        help="how often an addressed packet is sent again; without it the standard's 3 or 7",
        at_least=0,
        at_most=7,
    )

    @property
    def acknowledges(self) -> bool:
        """Whether senders learn what became of addressed packets."""
        return self.acknowledged and self.method in ("csma-802154", "dcf")
