"""Live runs: publishing for observers, and the process that shows them."""
