"""The loop over accepted steps, the state of rest, checkpoints and signals."""
