"""One test, in a process that has a changed module: `python -m tests.tools.reliability.one_test MODULE FOLDER TEST`.

The process ends with the test, whatever threads that left behind.
"""

import importlib
import os
import sys
import traceback

import pytest

OPTIONS = ("-q", "-x", "-p", "no:cacheprovider", "--tb=short", "--timeout=120")
NOT_LOADED = 99  # no exit code of pytest


def main(module: str, folder: str, test: str) -> int:
    """The test's exit code; NOT_LOADED if the module cannot be loaded, or is not the one in this folder."""
    try:
        file = importlib.import_module(module).__file__
    except Exception:  # noqa: BLE001 - whatever the change broke, this is no failure of the test
        traceback.print_exc()
        return NOT_LOADED
    if file is None or not file.startswith(folder):
        print(f"{module} was loaded from {file}")
        return NOT_LOADED
    return pytest.main([*OPTIONS, test])


if __name__ == "__main__":
    ended = main(*sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(ended)
