from typing import Any

from arto_settings import Settings as ArtoSettings

# A data-block: anything may be in it, but what ARTO puts there is known.
class _Block:
    def __getattr__(self, name: str) -> Any: ...
    def __setattr__(self, name: str, value: Any) -> None: ...
    def __getitem__(self, name: str) -> Any: ...
    def __setitem__(self, name: str, value: Any) -> None: ...
    def __delitem__(self, name: str) -> None: ...
    def __contains__(self, name: str) -> bool: ...

class Scene(_Block):
    arto: ArtoSettings

class _Dials:
    rotation: float
    strength: float
    tint: Any
    kit_light: int

class World(_Block):
    arto: _Dials

class _Switches:
    live: bool
    overlay: bool
    seen: str

class WindowManager(_Block):
    arto: _Switches

def __getattr__(name: str) -> Any: ...
