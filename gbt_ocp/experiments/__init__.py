"""Experiments: configurations, runs, and the folders they leave."""
