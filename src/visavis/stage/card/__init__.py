"""Drawing on a graphics card: buffers, textures, shaders and what they read. Which picture is drawn
from where is decided above, in `stage`.
"""
