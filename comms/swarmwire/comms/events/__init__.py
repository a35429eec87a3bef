"""Events: what a scenario does to robots and radios while a run goes on. One file per action, parameters and effect."""
