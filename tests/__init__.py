"""A package, so that `tests.scenes` is the one beside it."""
