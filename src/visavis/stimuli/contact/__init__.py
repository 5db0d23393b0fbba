"""Bodies as capsules: idle people, contact with a tracked participant, what they share."""
