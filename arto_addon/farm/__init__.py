"""A capture by many machines: plan a job, render its parts on any machine, gather the parts.

The farm's own engine hands out the parts and runs Blender. Nothing here waits for another machine.
"""
