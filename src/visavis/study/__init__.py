"""The declaration of a study, and how its trials unfold.

Here is what a study file writes and what follows from it alone: factors and parameters, the steps
of a trial, scenes and films, what is asked, what is measured and compared, which rules leave data
out, texts in every language, the sections a study adds to its report; the catalogue that finds
studies, and the experiment that hands a session its plan and its trials. Nobody is simulated here,
nothing is recorded, and no data are read: people, results and sessions stand in the rooms above.
"""
