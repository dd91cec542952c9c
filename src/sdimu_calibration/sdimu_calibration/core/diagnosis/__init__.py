"""What is missing in the error model: evidence from the residuals of a calibration."""
