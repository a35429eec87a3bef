"""What is measured of a run, recorded and drawn; it knows the contract in comms and neither world nor agents."""
