"""The tables of a scenario, checked each by itself; `scenario_file` reads them, `validation` checks how they fit."""
