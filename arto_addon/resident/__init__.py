"""The resident renderer: a Blender beside the window, which keeps what it has prepared."""
