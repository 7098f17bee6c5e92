"""Long work in a second Blender, on a snapshot of the file."""
