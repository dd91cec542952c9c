"""A simulated strapdown IMU on a rate table: the truth, from exact geometry.

Nothing of the calibrator's error model, navigation or filter is used here: truth and estimate meet only in
the names of coefficients. Frames n, t, b and signs as in doc/conventions.md.
"""
