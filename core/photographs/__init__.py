"""Photographs of a thing in known light, as pictures of a capture set (paper 4.2)."""
