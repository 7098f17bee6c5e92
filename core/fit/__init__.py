"""The support model of each pixel and patch: evidence, choice, search and fit (paper 5)."""
