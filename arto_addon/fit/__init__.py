"""Fitting what was captured of a shot, and the guides that its field carries (paper 5)."""
