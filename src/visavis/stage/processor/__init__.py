"""Drawing where a processor does the card's work: people skinned, lit and culled in compiled loops,
rooms lit once at their vertices.
"""
