"""Data for observers of a run, which agents never get: the truth, the interfaces of the loop, views of a run."""
