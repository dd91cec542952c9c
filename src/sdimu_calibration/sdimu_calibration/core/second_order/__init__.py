"""The estimator for errors of percents, whose squares count."""
