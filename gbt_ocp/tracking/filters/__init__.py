"""Filters and fits that the paper compares with."""
