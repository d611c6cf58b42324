"""The free-swelling block as an expert writes it in NGSolve and in DOLFINx; nothing here imports ngswell."""
