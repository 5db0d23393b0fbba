"""The page that shows a recorded session again: what goes into it, and its own code."""
