"""Actuators: agents' commands become targets of the engines, with limits of drives and noise of wheels; lights."""
