"""When a signature can be told from the coefficients of the model."""

TESTABLE = 0.02
"""Share of a signature's length that the model's coefficients must leave: with less they make the sigma of the effect
more than fifty times larger."""
