"""The stage: a copy of the scene to render, and what is set on it."""
