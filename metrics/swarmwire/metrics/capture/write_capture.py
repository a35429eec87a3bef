"""A capture as a file: pcapng with a section, one interface, and a packet per frame on air."""

from collections.abc import Iterable
from pathlib import Path

from swarmwire.metrics.atomic import output_file
from swarmwire.metrics.capture import pcapng
from swarmwire.metrics.capture.frame import Frame
from swarmwire.metrics.capture.link_headers import Link

APPLICATION = "swarmwire"


def write_capture(to: Path, link: Link, name: str, description: str, frames: Iterable[Frame]) -> int:
    """Write the frames, and say how many; BadInput if nothing can be written there.

    Times are since the run's start, which a reader takes for 1970. A payload that is not known is not captured, but
    counts in the frame's length.
    """
    count = 0
    with output_file(to) as part, part.open("wb") as file:
        file.write(pcapng.section(APPLICATION) + pcapng.interface(link.link_type, name, description))
        for frame in frames:
            header = link.header(frame)
            length = len(header) + frame.size_bytes
            file.write(pcapng.packet(frame.on_air_at_ns, header + frame.payload, length, frame.comments))
            count += 1
    return count
