"""What is right and where it ends: verification, chosen solutions, bodies in space, why Newton's method stops."""
