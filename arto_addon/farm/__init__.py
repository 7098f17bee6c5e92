"""A capture by many machines: a plan, parts that any of them renders, and what joins them.

Farms run Blender, and an engine of theirs hands out the parts; nothing here waits for another
machine.
"""
