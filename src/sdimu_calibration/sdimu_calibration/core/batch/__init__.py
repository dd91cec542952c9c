"""The estimators of another kind: one least squares over dwells and turns; the classical one from table angles."""
