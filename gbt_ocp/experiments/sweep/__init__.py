"""Monte Carlo: one experiment over many seeds and over any keys, on all cores or on a cluster."""
