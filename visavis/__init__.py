"""What a study file or a script imports."""
