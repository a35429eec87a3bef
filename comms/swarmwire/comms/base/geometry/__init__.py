"""Where obstacles, floors and robots are, in arrays that compiled kernels search."""
