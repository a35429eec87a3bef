"""Positions of obstacles, floors and robots in arrays that compiled kernels search."""
