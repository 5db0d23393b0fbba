"""Xsens MVN."""
