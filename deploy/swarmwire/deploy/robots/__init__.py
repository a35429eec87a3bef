"""Robots by the dozen: `fleet.toml`, and what `swarmwire robots` does with it over SSH."""
