"""Bodies as capsules: idle people, contact with a tracked participant, common volumes."""
