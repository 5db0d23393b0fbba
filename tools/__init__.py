"""What the house makes its own files with; not installed."""
