"""A Gaussian process on the shape of the target's motion, for noisy bearings."""
