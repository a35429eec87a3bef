"""Data that an agent may know: its body and sensors, messages, packets, and the readings and actions of a tick."""
