"""Capturing: a scene under the light of every patch, into a capture set (paper 4)."""
