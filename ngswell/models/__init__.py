"""Sets of unknowns: each gives its spaces and its residual as named terms."""
