"""From a prepared test to a fit, and from a fit to a result: the one way of every caller."""
