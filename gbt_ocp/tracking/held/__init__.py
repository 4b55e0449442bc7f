"""A bank of log-polar Kalman filters for targets that hold a turn rate and then draw another."""
