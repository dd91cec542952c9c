"""Runs by hand: no table, no place."""
