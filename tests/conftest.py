"""Settings for all tests: property tests draw the same in every run, and Ctrl-C is what it is to any program."""

import signal

from hypothesis import HealthCheck, settings

# The first example may wait for the compiler.
settings.register_profile(
    "swarmwire",
    deadline=None,
    derandomize=True,
    database=None,
    print_blob=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("swarmwire")


def pytest_configure() -> None:
    """What a shell starts in the background, or by nohup, ignores Ctrl-C or hang-ups; so would all that tests start."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
