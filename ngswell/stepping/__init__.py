"""Time integration: schemes, step controls, and the steps from kink to kink."""
