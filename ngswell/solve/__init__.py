"""One nonlinear solve and the linear solvers beneath it."""
