"""Salt baths on boundaries, and the ways of imposing Donnan equilibrium there; one treatment a file."""
