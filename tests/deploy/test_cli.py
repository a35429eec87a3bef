"""The command line as a whole."""

import subprocess
import sys

HEAVY = ("numba", "pydantic", "pymunk", "scipy", "polars", "zenoh", "matplotlib", "rerun")


def test_help_waits_for_no_heavy_library():
    code = f"import sys, swarmwire.deploy.cli; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.strip() == "[]"
