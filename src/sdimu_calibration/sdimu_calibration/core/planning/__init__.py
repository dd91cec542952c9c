"""A plan before it is run: perfect data, covariance simulation, bound, observability."""
