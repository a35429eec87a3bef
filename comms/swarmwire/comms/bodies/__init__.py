"""Kinds of robot: their data sheets, and those that come with swarmwire."""
