"""Radio parameters fitted to logs of real robots: pure functions from a log's arrays to estimates.

Here rather than in comms, as scipy and polars are dependencies of this part; of the radio it uses only the parameters.
"""
