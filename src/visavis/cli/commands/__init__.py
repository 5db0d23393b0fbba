"""Everything a user types: one module for one command, or for a few that belong together."""
