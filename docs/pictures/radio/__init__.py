"""The figures of the page on the radio, drawn by the radio's own functions."""
