"""What a run leaves behind in its folder, beside what metrics record."""
