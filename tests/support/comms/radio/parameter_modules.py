"""The modules of the radio that hold parameters of scenarios."""

from pkgutil import iter_modules

from swarmwire.comms.radio import config

MODULES = [
    "swarmwire.comms.radio.timing",
    *(f"{config.__name__}.{found.name}" for found in iter_modules(config.__path__)),
]
