"""Naturalness of gestures interpolated between key poses by three methods, judged from films."""
