"""Whether the certificate that a robot shows others goes with its key and its authority, before anything is opened.

The network would only fail to link, in silence, for ever.
"""

import ssl

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.network import Network

NOT_YET_VALID = 9  # X509_V_ERR_CERT_NOT_YET_VALID: a robot without a battery for its clock learns the date later


def check_proof(network: Network, where: str) -> None:
    """BadInput at `network.certificate`, `network.key` or `network.ca` in `where`, if they do not go together."""
    certificate, key, ca = network.certificate, network.key, network.ca
    if certificate is None or key is None or ca is None:
        return
    shows = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        shows.load_cert_chain(certificate, key, password="")  # or it would ask for one at the terminal
    except (ssl.SSLError, ValueError) as error:
        text = f"expected the key of {certificate}: {key} is none, or of another certificate ({_reason(error)})"
        raise BadInput(where, "network.key", text) from None
    asks = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    asks.check_hostname = False
    try:
        asks.load_verify_locations(ca)
    except ssl.SSLError as error:
        raise BadInput(where, "network.ca", f"expected a certificate: {ca} is none ({_reason(error)})") from None
    fault = _fault(shows, asks)
    if fault:
        raise BadInput(where, "network.certificate", f"expected one that {ca} signed: {certificate}: {fault}")


def _fault(shows: ssl.SSLContext, asks: ssl.SSLContext) -> str | None:
    """Why whoever asks would not take what the other shows; both ends talk in memory."""
    to_asker, to_shower = ssl.MemoryBIO(), ssl.MemoryBIO()
    asker = asks.wrap_bio(to_asker, to_shower)
    shower = shows.wrap_bio(to_shower, to_asker, server_side=True)
    for end in (asker, shower, asker):
        try:
            end.do_handshake()
        except ssl.SSLWantReadError:
            continue
        except ssl.SSLCertVerificationError as error:
            return None if error.verify_code == NOT_YET_VALID else error.verify_message
        except ssl.SSLError as error:
            return _reason(error)
    return None


def _reason(error: Exception) -> str:
    """What OpenSSL says, in a few words."""
    reason = getattr(error, "reason", None) or str(error)
    return str(reason).replace("_", " ").lower()
