"""Pictures and films that `visavis preview` draws."""
