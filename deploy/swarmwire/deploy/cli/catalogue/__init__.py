"""What a scenario, an agent or a command may name, taken from where each thing is declared.

`kinds` is the table of all kinds; a new one is a function that lists its entries, and its line there.
"""
