"""SR Research EyeLink."""
