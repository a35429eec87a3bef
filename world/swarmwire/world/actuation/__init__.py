"""From what agents ask for to what engines are given: limits of the drives, noise of the wheels, lights."""
