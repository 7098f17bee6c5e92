"""The reflectance field of Peers and Dutré on arrays, without Blender.

The rooms follow the data. `hemicube` and `patterns` describe the light that is sent (paper 3 and
4). `capture` holds the images that come back (4). `fit` chooses a support model for every pixel
and patch (5), `supports` holds the models, and `field` keeps the result on disk. `light` brings
the new environment onto the patches, and `relight` sums up the picture (6).
"""
