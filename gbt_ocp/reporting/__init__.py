"""Figures and tables, drawn from run folders only."""
