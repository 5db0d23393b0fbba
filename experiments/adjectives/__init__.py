"""Walks rated by pairs of adjectives: which pairs say something, and which belong together?"""
