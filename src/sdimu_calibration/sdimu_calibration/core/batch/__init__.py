"""The estimator of another kind: one least squares over dwells and turns."""
