"""The commands of `swarmwire`, one a file; `cli` lists them."""
