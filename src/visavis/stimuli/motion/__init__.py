"""How virtual humans move: rotations between key poses, clips, skeletons, retargeting, blending.

A motion is anything with `at(t_s)` that returns `Frames`: a pure function of time, for as many
times at once as there are people. Joints turn by quaternions (w, x, y, z) relative to their
parent; degrees and foreign units exist only in files.
"""
