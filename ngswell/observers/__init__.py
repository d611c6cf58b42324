"""What is watched during a run; one observer a file."""
