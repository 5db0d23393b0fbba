"""Placing things as arrays, wherever they are drawn: cameras, joints, what touches a floor."""
