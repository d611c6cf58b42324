"""Which treatment of a bath, which model, which accuracy, which solver."""
