"""Physics engines: one small interface, one file per engine."""
