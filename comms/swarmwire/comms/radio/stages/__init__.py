"""What a packet passes on its way to a receiver, one step each."""
