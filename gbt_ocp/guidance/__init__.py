"""Observer strategies: how the vehicle moves, behind one protocol."""
