"""Parameters of the air: a scenario with them is read without a compiler, and their defaults are allowed."""

import subprocess
import sys
from dataclasses import MISSING, fields, is_dataclass
from importlib import import_module
from pkgutil import iter_modules

import pytest

from swarmwire.comms.air import parameters
from swarmwire.comms.parameters import fault_of, limits_of

AIR = "swarmwire.comms.air"
MODULES = [
    *(f"{AIR}.{name}" for name in ("radio", "radio_checks", "presets.registry", "reception.noise")),
    *(f"{AIR}.propagation.{name}" for name in ("friis", "log_distance", "two_ray", "itu_indoor")),
    *(f"{AIR}.timing.{name}" for name in ("access_timing", "airtime")),
    *(f"{AIR}.parameters.{found.name}" for found in iter_modules(parameters.__path__)),
]
PARAMETERS = {
    thing
    for module in MODULES
    for thing in vars(import_module(module)).values()
    if isinstance(thing, type) and is_dataclass(thing) and thing.__module__ == module
}


def test_parameters_are_imported_without_a_compiler():
    code = f"import sys, {', '.join(MODULES)}; sys.exit('numba' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("kind", sorted(PARAMETERS, key=lambda one: one.__name__))
def test_defaults_are_within_limits_and_every_parameter_has_help(kind: type):
    for field in fields(kind):
        limits = limits_of(field)
        if "limits" not in field.metadata:
            continue
        assert limits.help, field.name
        if isinstance(field.default, int | float):
            assert fault_of(field.default, limits) is None, field.name
        if limits.choices and field.default not in (MISSING, None):
            assert field.default in limits.choices, field.name
