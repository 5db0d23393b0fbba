"""Tests of studies on a page."""
