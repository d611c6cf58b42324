"""What a user writes down: supports, loads, and the setup that puts all pieces together and checks them."""
