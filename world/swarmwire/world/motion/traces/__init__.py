"""Motion traces: files of robots' poses over time, their formats, and the poses at a time of a run."""
