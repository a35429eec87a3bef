"""Bodies: the kinds of robot, their specs, and the bundled ones as TOML files."""
