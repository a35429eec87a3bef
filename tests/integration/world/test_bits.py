"""Equal bits: every shipped scenario gives the committed hashes, whatever the machine's libraries and vector units."""

import os
import subprocess
import sys
from typing import Any

import pytest

ENVIRONMENTS = {
    "as it is": {},
    "generic x86-64 for kernels": {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": ""},
    "x86-64-v3 for kernels": {"NUMBA_CPU_NAME": "x86-64-v3", "NUMBA_CPU_FEATURES": ""},  # PORTABLE_CPU
    "numpy without vector units": {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"},
    "C library without FMA": {
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F,-AVX2_Usable,-FMA_Usable,-FMA4_Usable"
    },
}


def _cases() -> list[Any]:
    """Each environment; that which compiles all kernels anew takes minutes."""
    return [
        pytest.param(changes, id=name, marks=[pytest.mark.slow] if "NUMBA_CPU_NAME" in changes else [])
        for name, changes in ENVIRONMENTS.items()
    ]


@pytest.mark.timeout(900)
@pytest.mark.parametrize("changes", _cases())
def test_hashes_of_shipped_scenarios_are_equal_with(changes: dict[str, str]) -> None:
    if "NUMBA_CPU_NAME" in changes and os.uname().machine != "x86_64":
        pytest.skip("its target is x86-64")
    environment = {**os.environ, **changes}
    child = subprocess.run(
        [sys.executable, "-m", "tests.tools.bits"], env=environment, capture_output=True, text=True, check=False
    )
    assert child.returncode == 0, child.stdout + child.stderr
