"""Settings for all tests: property tests draw the same examples in every run."""

from hypothesis import settings

settings.register_profile("swarmwire", deadline=None, derandomize=True, database=None, print_blob=True)
settings.load_profile("swarmwire")
