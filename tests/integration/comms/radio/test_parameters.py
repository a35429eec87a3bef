"""A scenario with parameters of the medium is read without a compiler."""

import subprocess
import sys

from tests.support.comms.radio.parameter_modules import MODULES


def test_parameters_are_imported_without_a_compiler():
    code = f"import sys, {', '.join(MODULES)}; sys.exit('numba' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
