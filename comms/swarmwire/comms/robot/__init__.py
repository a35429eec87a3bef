"""Everything that an agent may know of its robot and of a tick: bodies, sensors, messages, packets, readings and actions."""
