"""Statistics over runs: of samples of numbers, some of them cut off by the time limit. No files, no figures."""
