"""Reception: whether a frame survives noise, interference and bursts. SINR is a ratio of powers; dB where named so."""
