"""Pages of many results: the fleet and the data sheet."""
