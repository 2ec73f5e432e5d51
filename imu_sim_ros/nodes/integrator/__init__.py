"""The integrator node."""
