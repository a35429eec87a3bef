"""Extras: optional dependencies, and one error that says how to get them."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from swarmwire.comms.base.errors import BadInput

TOOL_RECEIPT = "uv-receipt.toml"  # uv writes it into the environment of a tool


@dataclass(frozen=True)
class Extra:
    """An extra of a distribution in pip's notation, and the modules that it installs."""

    requirement: str
    modules: tuple[str, ...]

    def missing(self) -> Sequence[str]:
        """Return the modules that are not installed."""
        return [name for name in self.modules if find_spec(name) is None]

    def need(self, feature: str) -> None:
        """Raise BadInput about the `feature` that needs the modules, unless all of them are installed."""
        if missing := self.missing():
            raise BadInput(feature, "", f"needs {' and '.join(missing)}: {self.remedy()}")

    def remedy(self) -> str:
        """Return what installs the extra: a command for the programs of `make install`, else a requirement for pip."""
        distribution, _, extra = self.requirement.removesuffix("]").partition("[")
        if distribution.startswith("swarmwire") and Path(sys.prefix, TOOL_RECEIPT).exists():
            return f"make install EXTRAS={extra}"
        return f"install {self.requirement}"


CERTIFICATES = Extra("swarmwire[fleet]", ("cryptography",))
CLUSTER = Extra("swarmwire[cluster]", ("dask", "distributed"))
CRAZYFLIE = Extra("swarmwire-agent[crazyflie]", ("cflib",))  # under the GPL
FILM = Extra("swarmwire[film]", ("imageio_ffmpeg",))  # its wheel has ffmpeg, 80 MB
FLEET = Extra("swarmwire[fleet]", ("asyncssh", "cryptography", "packaging", "pip"))
LEARN = Extra("swarmwire[learn]", ("gymnasium", "pettingzoo"))
MAPS = Extra("swarmwire[maps]", ("shapely",))
MAVLINK = Extra("swarmwire[mavlink]", ("pymavlink",))
MCAP = Extra("swarmwire[ros2]", ("mcap", "rosbags"))
POLICY = Extra("swarmwire-agent[policy]", ("onnxruntime",))
REPORT = Extra("swarmwire-metrics[report]", ("matplotlib", "jinja2"))
ROS2 = Extra("swarmwire-agent[ros2]", ("rosbags", "xxhash"))
TEST = Extra("swarmwire[test]", ("pytest",))
TUNE = Extra("swarmwire[tune]", ("optuna",))
UI = Extra("swarmwire[ui]", ("fastapi", "uvicorn"))
VIEW = Extra("swarmwire[view]", ("rerun", "rerun_bindings"))  # its wheel has 170 MB
