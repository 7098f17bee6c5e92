"""Fit a shot's capture set to a field (paper 5), and denoise the guides that the field carries."""
