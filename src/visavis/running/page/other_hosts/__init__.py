"""Studies on other web hosts: bundles for them, and results that come back.

A course is a function of its replies. If its steps are the same for all answers, they can be
written in advance, one list for each place. The replies of people are then fed to the course.
"""
