"""Treatments of the same limits compared: on recorded problems, in closed loop, and over the penalty's settings."""
