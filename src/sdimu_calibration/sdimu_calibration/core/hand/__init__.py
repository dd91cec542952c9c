"""Calibration by hand: many attitudes, no table, no place."""
