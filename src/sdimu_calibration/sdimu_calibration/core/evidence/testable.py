"""When a signature can be told from the coefficients of the model, and two causes from each other."""

TESTABLE = 0.02
"""Share of a signature's length that the model's coefficients must leave: with less they make the sigma of the effect
more than fifty times larger."""
INDISTINGUISHABLE = 3.0
"""Difference of log-likelihoods or log Bayes factors (1) up to which two causes are not told apart: odds of 20 to 1 by
the data; what is known before them says which is likelier."""
WORST_SENSOR = 30.0
"""Factor on the one-sigma size that physics gives an effect: no sensor is worse, so what does not show at that size is
not seen."""
UNSEEN = f"could not have been seen even at {WORST_SENSOR:.0f} times their usual size"
"""What is said of effects that do not show at that size."""
