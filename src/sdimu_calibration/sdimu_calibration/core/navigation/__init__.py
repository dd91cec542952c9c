"""Strapdown navigation: reduction of samples, attitude, velocity and position, their errors, alignment."""
