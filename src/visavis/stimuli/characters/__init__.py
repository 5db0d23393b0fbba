"""Virtual humans as data: mesh, skin, eyes, body parts, collision capsules; and where they come
from.
"""
