"""Network interfaces of robots: namespaces, TAP devices, their frames on the radio medium, and programs."""
