"""A setup on its mesh: unknowns, forms, what has to stay positive, and the discrete system of one step."""
