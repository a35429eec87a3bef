"""`swarmwire certs`: its commands, one a file."""
