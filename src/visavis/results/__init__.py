"""From recorded sessions to tables, figures and a report, for any study made with the kit.

Here a session is taken in (`intake`), trials and people are left out by the study's rules
(`selection`), comparisons and families of tests are answered (`analysis`, `family_tests`), and
tables with their dictionary, figures and the report are written (`outputs`). Power, the locked plan
and the data's quality belong to it. An `OpenedStudy` is how commands and scripts ask for all of
this. Not here: statistics and measures that know no study (`visavis.analysis`), and whole studies
worked through session by session (`visavis.running`).
"""
