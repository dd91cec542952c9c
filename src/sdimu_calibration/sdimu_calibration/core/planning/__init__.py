"""A plan before it is run: perfect data, covariance simulation, bound, observability. SI units, frames n, t, b."""
