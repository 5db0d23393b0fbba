"""Drawing on a graphics card: buffers, textures, shaders and their inputs. Which picture is drawn
from where is decided in `stage`.
"""
