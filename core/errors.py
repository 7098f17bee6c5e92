"""The errors that ARTO raises: each message says what is wrong and what to do about it."""


class ArtoError(Exception):
    """Base of all of them; operators turn it into a report, the command line into an exit code."""


class HemicubeError(ArtoError):
    """A hemicube that cannot be: no faces, no patches, no size."""


class PatternError(ArtoError):
    """An unknown set of patterns, or one that cannot identify what was asked of it."""


class ExrError(ArtoError):
    """An EXR file that is missing, truncated, or not what it should be."""


class CaptureSetError(ArtoError):
    """A capture set that is incomplete, damaged, or belongs to something else."""


class FieldError(ArtoError):
    """A reflectance field that is missing, damaged, or of another version."""


class EnvironmentMapError(ArtoError):
    """An environment map that cannot light anything."""


class SceneError(ArtoError):
    """A Blender scene that cannot be captured or relit as it stands."""


class ShotError(ArtoError):
    """A description of a shot that is none, or a shot that is another's."""


class BusyError(ArtoError):
    """Another process is at work on the same shot."""


class CancelledError(ArtoError):
    """The artist stopped the work. Whatever was finished is kept."""


class FarmError(ArtoError):
    """A farm's job that is incomplete, damaged, or of another scene."""
