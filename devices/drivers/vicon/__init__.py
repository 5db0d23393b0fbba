"""Vicon Tracker."""
