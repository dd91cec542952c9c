"""From samples to a test that is ready for an estimator: phases, stops, levelling, coarse alignment."""
