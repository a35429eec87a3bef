"""Settings for all tests: property tests draw the same examples in every run."""

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
