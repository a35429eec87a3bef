"""Times of a radio: when packets are sent, how long they are on air, and how late they are heard."""
