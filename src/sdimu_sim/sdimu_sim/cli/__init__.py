"""Verbs that need the simulators: arguments in one file per verb, the work elsewhere."""
