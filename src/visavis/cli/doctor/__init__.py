"""Examinations that `visavis doctor` makes, and their report."""
