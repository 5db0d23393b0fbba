"""Studies on a web host that is not ours: bundles for it, and results that come back.

A course is a function of its replies. Where its steps are the same whatever is answered, they can
be written down beforehand, one list for each place; what people did then leads the course itself.
"""
