"""Handheld runs: no table, no site."""
