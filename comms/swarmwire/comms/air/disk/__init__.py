"""The disk's way: queues of senders, who is within range, and the chain of stages."""
