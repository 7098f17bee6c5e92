"""A simulated photographer: a scene photographed as a laboratory would photograph a thing."""
