"""Radio parameters fitted to logs of real robots: pure functions from a log's arrays to estimates.

The package is part of metrics, since metrics depends on scipy and polars; it uses only the radio's parameters.
"""
