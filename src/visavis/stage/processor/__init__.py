"""Drawing without a graphics card: compiled loops skin, light and cull people; rooms are lit once
at their vertices.
"""
