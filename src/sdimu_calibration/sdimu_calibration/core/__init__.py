"""Pure functions and frozen dataclasses on numpy arrays: no ROS, no files, no plots, no clocks.

Frames, units, signs and names are declared once, in doc/conventions.md.
"""
