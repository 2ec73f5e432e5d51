"""Bias, scale, misalignment, g-sensitivity and temperature from calibration runs."""
