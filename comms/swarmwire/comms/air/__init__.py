"""The emulated medium: decides which robots hear a packet, when, how strong, or why not. Needs the extra `[air]`."""
