"""`swarmwire ctl`: runs that go on, watched and changed from another terminal."""
