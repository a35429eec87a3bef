"""Events: the changes to robots and radios during a run that a scenario lists."""
