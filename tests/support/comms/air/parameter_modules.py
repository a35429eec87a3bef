"""The modules of the air that hold parameters of scenarios."""

from pkgutil import iter_modules

from swarmwire.comms.air import parameters

AIR = "swarmwire.comms.air"
MODULES = [
    *(f"{AIR}.{name}" for name in ("radio", "radio_checks", "presets.registry", "reception.noise")),
    *(f"{AIR}.propagation.{name}" for name in ("friis", "log_distance", "two_ray", "itu_indoor")),
    *(f"{AIR}.timing.{name}" for name in ("access_timing", "airtime")),
    *(f"{AIR}.parameters.{found.name}" for found in iter_modules(parameters.__path__)),
]
