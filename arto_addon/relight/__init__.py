"""Relighting: the field under the world, denoised, as a plate (paper 6)."""
