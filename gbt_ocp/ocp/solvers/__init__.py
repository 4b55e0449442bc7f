"""Solvers of the trajectory problem behind one protocol."""
