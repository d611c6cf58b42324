"""The body itself: how it may deform, what it is made of, and the laws of its solid, its pores and its ions."""
