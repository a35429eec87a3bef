"""A run as people see it in a terminal, and the keys that they steer it with."""
