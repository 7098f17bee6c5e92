"""The light kit as a world's nodes: one node group for each light, over a base."""
