"""A Gaussian process on the target's displacement, for noisy bearings."""
