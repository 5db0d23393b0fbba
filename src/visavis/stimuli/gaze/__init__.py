"""How agents' eyes behave: where they point, how they move there, when they blink."""
