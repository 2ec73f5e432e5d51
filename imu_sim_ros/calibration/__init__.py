"""What is recovered of a sensor from its readings: noise, and deterministic errors."""
