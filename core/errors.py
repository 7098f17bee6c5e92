"""The errors that ARTO raises. Each message says what is wrong and what to do about it.

Examples
--------
>>> from arto.core.patterns import pattern_set
>>> try:
...     pattern_set("whtie")
... except ArtoError as error:
...     print(str(error)[:48])
no pattern set 'whtie': choose one of moments, m
"""


class ArtoError(Exception):
    """The base of all errors of ARTO.

    Operators turn it into a report, the command line into an exit code.
    """


class HemicubeError(ArtoError):
    """A hemicube that cannot exist: it has no faces, no patches or no size."""


class PatternError(ArtoError):
    """An unknown set of patterns, or a set that cannot identify the moments that were asked for."""


class ExrError(ArtoError):
    """An EXR file that is missing or truncated, or that holds something else than expected."""


class CaptureSetError(ArtoError):
    """A capture set that is incomplete or damaged, or that belongs to something else."""


class FieldError(ArtoError):
    """A reflectance field that is missing, damaged, or of another version."""


class EnvironmentMapError(ArtoError):
    """An image that cannot be used as an environment map."""


class TargetError(ArtoError):
    """A picture that no light can be looked for: of another shape, empty, or masked out."""


class SceneError(ArtoError):
    """A Blender scene that cannot be captured or relit as it stands."""


class DeviceMemoryError(SceneError):
    """A render for which the device that renders has not the memory."""


class ShotError(ArtoError):
    """A text that is no description of a shot, or the description of another shot."""


class BusyError(ArtoError):
    """Another process is at work on the same shot."""


class CancelledError(ArtoError):
    """The artist stopped the work. Whatever was finished is kept."""


class FilesError(ArtoError):
    """A file or folder that is not ARTO's to change or remove, or that cannot be written."""


class StrictError(ArtoError):
    """A warning that counts as an error, because the caller asked for that."""


class PhotographsError(ArtoError):
    """Photographs that cannot become a shot: one is missing, of another size, or cannot be read."""


class FarmError(ArtoError):
    """A farm's job that is incomplete or damaged, or that was made for another scene."""


class KitError(ArtoError):
    """A light kit that cannot be: a number out of bounds, or a description of something else."""


class WebError(ArtoError):
    """A shot for a page in a browser that is damaged, or that cannot be made."""
