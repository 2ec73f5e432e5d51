"""What is made of readings: dead reckoning, preintegration, and their comparison with the truth."""
