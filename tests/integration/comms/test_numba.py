"""numba for users: swarmwire compiles its own functions in its own way, and leaves numba as it is."""

import subprocess
import sys

# Attributes of numba's and llvmlite's modules, and of the classes in them.
SNAPSHOT = """
import importlib, sys
import numba.core.compiler, numba.np.arraymath, numba.np.linalg
import numpy as np

def is_numba(name):
    return name.partition(".")[0] in ("numba", "llvmlite")

def snapshot():
    attributes = {}
    for name in filter(is_numba, list(sys.modules)):
        for attribute, value in list(vars(sys.modules[name]).items()):
            attributes[name, attribute] = value
            if isinstance(value, type) and is_numba(value.__module__):
                attributes |= {(name, attribute, member): defined for member, defined in list(vars(value).items())}
    return attributes

numba.njit(lambda x: np.sqrt(x))(1.0)  # numba completes itself as it first compiles
before = snapshot()
for module in ("comms.radio.medium", "world.world", "metrics.measures.measure", "deploy.runs.simulation"):
    importlib.import_module(f"swarmwire.{module}")
from swarmwire.comms.base.kernels import njit
assert njit(cache=False)(lambda x: np.sqrt(x))(4.0) == 2.0
after = snapshot()
print([key for key, value in before.items() if after.get(key) is not value])
"""


def test_numba_keeps_its_attributes_when_swarmwire_compiles():
    printed = subprocess.run([sys.executable, "-c", SNAPSHOT], capture_output=True, text=True, check=True)
    assert printed.stdout == "[]\n"
