"""Trackers: estimators of the target's motion behind one protocol."""
