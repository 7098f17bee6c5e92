"""What differs between versions of Blender: asked for here, and nowhere else."""
