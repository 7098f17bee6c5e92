"""Photographs of a real thing, opened as a shot."""
