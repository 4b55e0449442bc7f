"""The tracker of the paper: a Gaussian process on the target's position."""
