"""Public scenarios: the same recorded bearings for our trackers, those of other packages, and particle filters."""
