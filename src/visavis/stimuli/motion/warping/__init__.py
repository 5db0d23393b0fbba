"""Warp a motion so that an observer sees more or less of it: a visual control loop steers features
of the perceived image.
"""
