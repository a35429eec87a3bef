"""What the particle swarms share: a particle's memory, the rule, wheels, and places."""
