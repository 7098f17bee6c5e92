"""What tests of EXR files share."""

from __future__ import annotations

import numpy as np


def layers(size: tuple[int, int] = (37, 23), seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {
        "Combined": (10 ** rng.uniform(-30, 30, (*size, 4))).astype(np.float32),
        "ViewLayer.Combined_ARTO_0003_u2": rng.random((*size, 3), np.float32),
        "Depth": -rng.random(size, np.float32),
    }


def same(found: dict[str, np.ndarray], given: dict[str, np.ndarray]) -> None:
    assert list(found) == list(given)
    for name, pixels in given.items():
        expected = pixels[..., None] if pixels.ndim == 2 else pixels
        assert found[name].dtype == expected.dtype
        np.testing.assert_array_equal(found[name], expected)
