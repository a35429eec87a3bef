"""Certificates of a swarm's network: a certificate authority (CA) in a folder, and a certificate for each name."""
