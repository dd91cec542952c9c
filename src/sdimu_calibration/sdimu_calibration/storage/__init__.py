"""Bags, configuration files and result files, to and from the dataclasses of the core: a room for each."""
