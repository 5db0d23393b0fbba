"""What is examined by `visavis doctor`."""
