"""Parameters of the air: a scenario with them is read without a compiler, and their defaults are allowed."""

import subprocess
import sys
from dataclasses import MISSING, fields, is_dataclass
from importlib import import_module

import pytest

from swarmwire.comms.parameters import fault_of, limits_of

MODULES = [
    f"swarmwire.comms.air.{name}"
    for name in (
        "radio",
        "propagation.parameters",
        "propagation.friis",
        "propagation.log_distance",
        "propagation.two_ray",
        "propagation.itu_indoor",
        "reception.parameters",
        "reception.noise",
        "signal.parameters",
        "presets",
        "preset_tables.success",
        "radio_checks",
        "traces.parameters",
        "traffic.parameters",
        "traffic.access_timing",
        "traffic.airtime",
    )
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


@pytest.mark.parametrize("parameters", sorted(PARAMETERS, key=lambda kind: kind.__name__))
def test_defaults_are_within_limits_and_every_parameter_has_help(parameters: type):
    for field in fields(parameters):
        limits = limits_of(field)
        if "limits" not in field.metadata:
            continue
        assert limits.help, field.name
        if isinstance(field.default, int | float):
            assert fault_of(field.default, limits) is None, field.name
        if limits.choices and field.default not in (MISSING, None):
            assert field.default in limits.choices, field.name
