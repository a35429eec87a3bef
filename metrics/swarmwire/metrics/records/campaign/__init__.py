"""A campaign's folder: the parameters varied, and the results of each run."""
