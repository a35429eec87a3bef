"""The radio with signals: strength, noise, interference and access to the medium, as one run of events."""
