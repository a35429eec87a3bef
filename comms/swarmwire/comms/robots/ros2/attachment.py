"""What rmw_zenoh attaches to each message; a subscriber drops those that come without.

Sequence number and time of the source as little-endian int64, then the publisher's id of 16 bytes, as zenoh's
serializer writes them: 33 bytes. (rmw_zenoh: attachment_helpers.cpp.)
"""

import struct
from hashlib import blake2b

from swarmwire.comms.errors import BadFrame

LAYOUT = struct.Struct("<qqB16s")
ID_BYTES = 16


def publisher_id(token: str) -> bytes:
    """An id of 16 bytes that follows from the publisher's liveliness token, so none has that of another."""
    return blake2b(token.encode(), digest_size=ID_BYTES).digest()


def attachment(sequence: int, utc_ns: int, publisher: bytes) -> bytes:
    """The attachment of a message; `publisher` is its `publisher_id`."""
    return LAYOUT.pack(sequence, utc_ns, ID_BYTES, publisher)


def check_attachment(attached: bytes | None) -> None:
    """Raise BadFrame if a message has no attachment, or one of another layout."""
    if attached is None or len(attached) != LAYOUT.size or attached[16] != ID_BYTES:
        size = 0 if attached is None else len(attached)
        raise BadFrame("no_attachment", f"expected an attachment of {LAYOUT.size} bytes, got {size}")
