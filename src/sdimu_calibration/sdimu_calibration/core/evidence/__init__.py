"""A linear model of a recording about a fit: whitened residuals, and how each parameter shows in them."""
