"""The Kalman filter: one compiled pass over a recording, passes until nothing moves."""
