"""The tables of a scenario, checked one by one; `scenario_file` reads them, `validation` checks their combination."""
