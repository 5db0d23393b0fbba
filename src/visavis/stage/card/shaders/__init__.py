"""The programs of the graphics card as text, in GLSL."""
