"""The mix of a plate's layers, and scripts for compositors that make it."""
