"""What observers of a run see, and an agent never does: the truth, the interfaces of the loop, views of a run."""
