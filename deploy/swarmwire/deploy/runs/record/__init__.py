"""The run folder: provenance, inputs and logs for a repeat; its tables are in metrics."""
