"""The certificates of one end of a zenoh link: both ends show theirs, whoever called."""

from typing import Any

from swarmwire.comms.wire.network import Network


def mutual_tls(network: Network) -> dict[str, Any]:
    """Zenoh's `transport/link/tls` for a member with these certificates."""
    certificate, key = str(network.certificate), str(network.key)
    return {
        "root_ca_certificate": str(network.ca),
        "enable_mtls": True,
        "listen_certificate": certificate,
        "listen_private_key": key,
        "connect_certificate": certificate,
        "connect_private_key": key,
    }
