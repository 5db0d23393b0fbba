"""What is drawn by `visavis preview`."""
