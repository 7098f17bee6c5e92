"""The reflectance field of Peers and Dutré, on arrays: no Blender here.

`hemicube` and `patterns` say how the light was made (paper 3 and 4), `capture_set` holds what it
gave, `fit` with `supports` explains it (5), `field` keeps the explanation, `environment` and
`light` bring the new light and `relight` shows it (6).
"""
