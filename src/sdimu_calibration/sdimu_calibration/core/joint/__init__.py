"""Several recordings of one IMU as one least squares (decision 0012)."""
