"""The verbs of the studies: arguments, and what runs them."""
