"""Hybrid animation beside the clips it was taken from: which looks better?"""
