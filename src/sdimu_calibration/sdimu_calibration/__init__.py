"""Navigation-level calibration of a strapdown inertial measurement unit on a rate table."""
