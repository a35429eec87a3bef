"""Records of runs and campaigns: written, read back and checked."""
