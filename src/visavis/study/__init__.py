"""The declaration of a study, and how its trials unfold.

This package holds everything in a study file and everything that follows from the file alone:
factors and parameters, the steps of a trial, scenes and films, questions, measures and comparisons,
rules of exclusion, texts in every language, and sections of the report; also the catalogue that
finds studies, and the experiment that gives a session its plan and its trials. It simulates nobody,
records nothing and reads no data: people, results and sessions are in other packages.
"""
