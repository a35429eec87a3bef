"""The scenario: from a file to checked, frozen tables."""
