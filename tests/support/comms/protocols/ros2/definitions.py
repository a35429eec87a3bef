"""Definitions of ROS 2 messages as files, for a client that would clone them from the network: those of rosbags."""

from collections.abc import Iterable
from pathlib import Path

from swarmwire.comms.protocols.ros2.messages import Messages


def write_definitions(folder: Path, kinds: Iterable[str]) -> Path:
    """Write the .msg files of these types, and of the types in them, as packages have them; return the folder."""
    store = Messages("jazzy")._store
    for kind in kinds:
        text, _ = store.generate_msgdef(kind, ros_version=2)
        own, *others = text.split("=" * 80 + "\n")
        _write(folder, kind, own)
        for other in others:
            name, _, definition = other.partition("\n")
            package, _, short = name.removeprefix("MSG: ").partition("/")
            _write(folder, f"{package}/msg/{short.removeprefix('msg/')}", definition)
    return folder


def _write(folder: Path, kind: str, definition: str) -> None:
    path = folder / f"{kind}.msg"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(definition, encoding="utf-8")
