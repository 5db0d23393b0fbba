"""Crowd navigation with armbands that answer contact (after Berton et al. 2020)."""
