"""Warp a motion so that an observer sees more or less of it: features of what is perceived,
steered by a visual control loop.
"""
