"""The paper repeated, and treatments of limits compared."""
