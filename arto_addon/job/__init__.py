"""Long work in a Blender of its own, on a snapshot of the file."""
