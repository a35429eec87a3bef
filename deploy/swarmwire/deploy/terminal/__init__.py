"""Output to a terminal: plain lines, a console with colours, and tables."""
