"""The studies, one package each.

Design, trial, scene, measures, analysis, simulated participant, published figures.
"""
