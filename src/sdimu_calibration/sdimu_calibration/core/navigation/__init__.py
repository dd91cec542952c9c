"""Strapdown navigation: samples to cycles, attitude, velocity and position, their errors, the predicted track.

SI units. Frame n is local-level North, East, Down, frame b the body. Attitude `C_nb` maps b to n, velocity is
N, E, D (m/s), position is latitude (rad), longitude (rad), height (m). Coefficients and regressors are in the SI units
of their effects: regressor times coefficient is a rate (rad/s) or a specific force (m/s^2).
"""
