"""The workbench: the loop "compare, see where it fails, add, watch the error fall" in a browser."""
