"""What every column of every table is, and of which type."""
