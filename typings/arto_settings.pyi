"""The settings on `scene.arto`, made of the table: `python -m tools.setting_types`."""

from typing import Any, Literal

from arto_lists import Groups, Lamps, Looks

class Settings:
    preset: Literal["full", "paper", "custom"]
    faces: set[Literal["top", "left", "right", "back", "front", "bottom"]]
    half_sides: bool
    patches: int
    adaptive: bool
    align: Literal["world", "camera"]
    rotation: float
    far: bool
    size: float
    samples: int
    quality: Literal["DRAFT", "GOOD", "FINAL", "CUSTOM"]
    patterns: Literal["moments", "moments_uv", "linear", "paper", "white", "packed", "packed_linear", "lobes", "auto"]
    grain: bool
    route: Literal["all", "pattern", "single"]
    seed: int
    memory: int
    keep: Literal["never", "fits", "always"]
    keep_limit: float
    support: Literal["auto", "whole", "linear", "box", "quadratic", "oriented_box", "gaussian", "double", "bell", "leaning", "search", "stage_and_matte"]
    separate: bool
    own_lamps: float
    lamps: bool
    lamp_samples: int
    denoise: bool
    environment_width: int
    look: str
    output: str
    overwrite: bool
    layers: Literal["OFF", "FACES", "GROUPS"]
    layer_prefix: str
    layers_files: Literal["ONE", "EACH"]
    layers_half: bool
    scripts: bool
    write_data: bool
    cryptomatte: str
    shadows: Literal["MULTIPLY", "ADD"]
    compression: Literal["ZIPS", "ZIP", "DWAA"]
    depth: Literal["HALF", "FLOAT"]
    data_window: Literal["FULL", "CROP"]
    overscan: int
    use_in_compositor: Literal["VIEWER", "RENDER"]
    compare: Literal["OFF", "SIDE", "WIPE", "RENDER"]
    wipe: float
    footage: Any
    live_finish: bool
    live_first: bool
    finish_samples: int
    looks: Looks
    active_look: int
    own_groups: Lamps
    active_own_group: int
    groups: Groups
    active_group: int
    match_target: str
    match_image: Any
    match_mask: Any
    match_keep: Any
    match_change: Literal["LIGHT", "GAINS", "TURN"]
    match_colours: bool
    match_own: bool
    match_near: float
    match_exposure: bool
    match_balance: bool
    folder: str
    scene_id: str
    photographs: str
    alone: str
    bl_rna: Any
    def is_property_set(self, name: str) -> bool: ...
