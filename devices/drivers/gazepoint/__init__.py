"""Gazepoint GP3."""
