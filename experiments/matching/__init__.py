"""Walks moulded after a target by four adjectives, four features, or 27 weights."""
