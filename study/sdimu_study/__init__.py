"""Claims of the method put to the test: many simulated tests, calibrated or diagnosed, scored by the truth."""
