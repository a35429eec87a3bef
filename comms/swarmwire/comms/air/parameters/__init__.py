"""What a scenario says of its radio, a file each. No kernels here: a scenario is read without a compiler."""
