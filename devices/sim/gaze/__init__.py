"""Errors and calibration of every simulated eye tracker."""
