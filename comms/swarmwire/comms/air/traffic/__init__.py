"""Traffic: how long frames take on air, how long senders wait for it, and what comes on top before they are heard."""
