"""What a state tells: stability, estimated errors, why a step fails."""
