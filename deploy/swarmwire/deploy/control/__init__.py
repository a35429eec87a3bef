"""Control over runs that go on, from other processes: one implementation behind `swarmwire ctl` and the page."""
