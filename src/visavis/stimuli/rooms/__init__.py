"""Places drawn around people: solids, surfaces, furniture, and the three rooms of the studies."""
