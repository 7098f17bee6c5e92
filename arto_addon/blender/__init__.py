"""What differs between versions of Blender. All other folders ask this one."""
