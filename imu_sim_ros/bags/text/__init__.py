"""Text forms: EuRoC, CSV, TUM."""
