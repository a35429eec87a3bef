"""Names that a scenario, an agent or a command can use, read from their declarations.

`kinds` has the table of all kinds; a new kind is a function that returns its entries, and its line in the table.
"""
