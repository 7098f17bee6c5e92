"""Hard cases for every support model: synthetic basis images from planted transports.

No renderer: a case says how much of each point of a patch reaches each of a few hundred pixels; the
basis images, with noise, and the true relit pixels follow from it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from arto.core.capture.moments import Moments
from arto.core.fit.search import search
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.patterns import PATTERN_SETS, PatternSet, monomials
from arto.core.supports import BOX, SUPPORTS
from numpy.typing import NDArray

PIXELS = 128
GRID = 64
HEMICUBE = Hemicube()
# A patch in the middle of a face's rim: a patch border and a face border.
PATCH = 12
CHANNELS = np.array([1.0, 0.7, 0.4])

Case = Callable[[np.random.Generator, NDArray, NDArray], NDArray]


def _boxes(u: NDArray, v: NDArray, edges: NDArray) -> NDArray:
    """Uniform boxes (n, 4) as densities over the grid -> (n, GRID, GRID)."""
    u0, u1, v0, v1 = (e[:, None, None] for e in edges.T)
    inside = (u >= u0) & (u <= u1) & (v >= v0) & (v <= v1)
    return inside.astype(np.float64)


def _random_boxes(rng: np.random.Generator, least: float, most: float) -> NDArray:
    size = rng.uniform(least, most, (PIXELS, 2))
    low = rng.uniform(0, 1, (PIXELS, 2)) * (1 - size)
    return np.stack([low[:, 0], low[:, 0] + size[:, 0], low[:, 1], low[:, 1] + size[:, 1]], axis=-1)


def _point(rng: np.random.Generator, u: NDArray, v: NDArray) -> NDArray:
    out = np.zeros((PIXELS, GRID, GRID))
    out[np.arange(PIXELS), rng.integers(0, GRID, PIXELS), rng.integers(0, GRID, PIXELS)] = 1
    return out


def _line(rng: np.random.Generator, u: NDArray, v: NDArray) -> NDArray:
    out = np.zeros((PIXELS, GRID, GRID))
    out[np.arange(PIXELS), :, rng.integers(0, GRID, PIXELS)] = 1
    return out


def _border(rng: np.random.Generator, u: NDArray, v: NDArray) -> NDArray:
    edges = _random_boxes(rng, 0.05, 0.3)
    edges[::2, :2] -= edges[::2, :1]
    edges[1::2, 2:] += 1 - edges[1::2, 3:]
    return _boxes(u, v, edges)


def _box(rng: np.random.Generator, u: NDArray, v: NDArray) -> NDArray:
    return _boxes(u, v, _random_boxes(rng, 0.1, 1.0))


def _whole(rng: np.random.Generator, u: NDArray, v: NDArray) -> NDArray:
    return np.ones((PIXELS, GRID, GRID))


def _cosine(rng: np.random.Generator, u: NDArray, v: NDArray) -> NDArray:
    """Diffuse reflection: a plane over the patch, cut at a horizon."""
    a, b, c = rng.normal(size=(3, PIXELS, 1, 1))
    return np.maximum(a * (u - 0.5) + b * (v - 0.5) + 0.3 * np.abs(c), 0) + 1e-3


def _lobes(rng: np.random.Generator, u: NDArray, v: NDArray) -> NDArray:
    one, two = (_boxes(u, v, _random_boxes(rng, 0.05, 0.15)) for _ in range(2))
    return one + two


def _coat(rng: np.random.Generator, u: NDArray, v: NDArray) -> NDArray:
    """A broad base under a narrow coat."""
    narrow = _boxes(u, v, _random_boxes(rng, 0.05, 0.2))
    share = rng.uniform(0.2, 0.8, (PIXELS, 1, 1))
    return (1 - share) + share * narrow / np.maximum(narrow.mean(axis=(1, 2), keepdims=True), 1e-9)


def _tilted(rng: np.random.Generator, u: NDArray, v: NDArray) -> NDArray:
    """A long ellipse across the patch's axes."""
    turn = rng.uniform(0, np.pi, (PIXELS, 1, 1))
    x, y = u - 0.5, v - 0.5
    along, across = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    return np.exp(-((along / 0.2) ** 2) - (across / 0.05) ** 2)


def _checker(rng: np.random.Generator, u: NDArray, v: NDArray) -> NDArray:
    cells = rng.integers(2, 9, (PIXELS, 1, 1))
    return ((np.floor(u * cells) + np.floor(v * cells)) % 2).astype(np.float64)


CASES: dict[str, Case] = {
    "point": _point,
    "line": _line,
    "box": _box,
    "thin box at border": _border,
    "full patch": _whole,
    "cosine": _cosine,
    "two lobes": _lobes,
    "coat on base": _coat,
    "tilted ellipse": _tilted,
    "checkerboard": _checker,
}


def _damage(kind: str, amount: float, basis: NDArray, rng: np.random.Generator) -> NDArray:
    """Basis images (P, n, 3) with noise of a kind: relative size `amount`."""
    if kind == "shared":
        return basis * (1 + amount * rng.uniform(-1, 1, (1, basis.shape[1], 1)))
    if kind == "independent":
        return np.maximum(basis * (1 + amount * rng.normal(size=basis.shape)), 0)
    if kind == "half float":
        return basis.astype(np.float16).astype(np.float64)
    if kind == "fireflies":
        hit = rng.random((basis.shape[1], 1)) < 0.02
        # one bright path at one place of the patch, in all patterns as that place shows them
        place = monomials(rng.random(basis.shape[1]), rng.random(basis.shape[1]))[: len(basis)]
        return basis + np.where(hit, 1e3 * basis[0], 0) * place[:, :, None]
    if kind == "scale":
        return basis * amount
    if kind == "zero":
        return basis * (np.arange(basis.shape[1]) % 2)[:, None]
    if kind == "one channel":
        return basis * np.array([1.0, 0.0, 1.0])
    if kind == "nan and negative":
        out = basis.copy()
        out[:, ::7] = np.nan
        out[:, 1::7] *= -1
        return out
    return basis


DAMAGE = (
    ("none", 0.0),
    *(("shared", a) for a in (0.1, 0.4)),
    *(("independent", a) for a in (0.01, 0.1, 0.4)),
    ("half float", 0.0),
    ("fireflies", 0.02),
    ("scale", 1e-8),
    ("scale", 1e8),
    ("zero", 0.0),
    ("one channel", 0.0),
    ("nan and negative", 0.0),
)


def environments() -> dict[str, PatchLight]:
    """Light on the patches, GRID bins a side: smooth, rough, and the hardest."""
    rng = np.random.default_rng(7)
    height, width = 8 * GRID, 16 * GRID
    rough = rng.lognormal(0, 1, (32, 64, 3)).repeat(16, 0).repeat(16, 1)
    v, u = np.mgrid[:height, :width] / height
    smooth = 1 + np.sin(np.pi * u) * np.cos(np.pi * v)
    sun = np.ones((height, width, 3))
    # half a degree, 1e6 times the sky, on the border of the patch in question
    d = HEMICUBE.directions(PATCH, np.array(0.5), np.array(0.0))
    row = int((0.5 - np.arctan2(d[2], np.hypot(d[0], d[1])) / np.pi) * height)
    column = int((0.5 - np.arctan2(d[1], d[0]) / (2 * np.pi)) * width)
    sun[row : row + 2, column : column + 2] = 1e6
    checks = 1.0 + ((u * 16).astype(int) + (v * 16).astype(int)) % 2
    maps = {
        "rough": rough,
        "smooth": np.dstack([smooth] * 3),
        "sun on the border": sun,
        "checkerboard": np.dstack([checks] * 3),
    }
    return {
        name: PatchLight(Environment(image.astype(np.float32)), HEMICUBE, GRID)
        for name, image in maps.items()
    }


def _place(moments: NDArray) -> NDArray:
    """Mean and deviations along u and v of normalised moments (6, n) -> (4, n)."""
    mu, mv = moments[1], moments[3]
    deviations = [np.sqrt(np.maximum(moments[i] - m * m, 0)) for i, m in ((2, mu), (4, mv))]
    return np.stack([mu, mv, *deviations])


def _fitted_place(name: str, parameters: NDArray, moments: Moments) -> NDArray | None:
    """Mean and deviations of a fitted support, None for models without a shape."""
    if name in ("box", "search"):
        u0, u1, v0, v1 = parameters.T
        s = np.sqrt(12)
        return np.stack([(u0 + u1) / 2, (v0 + v1) / 2, (u1 - u0) / s, (v1 - v0) / s])
    if name in ("oriented_box", "gaussian"):
        return np.stack([parameters[:, 0], parameters[:, 1], *(parameters[:, 2:4].T / 2)])
    return None


def run_case(
    case: str, kind: str, amount: float, lights: dict[str, PatchLight], patterns: PatternSet
) -> list[dict[str, Any]]:
    """All models on one case with one kind of noise."""
    rng = np.random.default_rng([sum(map(ord, case)), 1])
    light = next(iter(lights.values()))
    extent = light.hemicube.extent(PATCH)
    u, v = light.bin_centres(PATCH)
    transport = CASES[case](rng, u[None, :], v[:, None])
    # a transport counts by solid angle
    transport = transport * light.binned[PATCH, ..., 3]
    transport /= transport.sum(axis=(1, 2), keepdims=True)
    m = np.einsum("mij,nij->mn", monomials(u[None, :], v[:, None]), transport)
    clean = np.einsum("pm,mn->pn", patterns.matrix, m)[..., None] * CHANNELS
    basis = _damage(kind, amount, clean, rng)
    usable = np.isfinite(basis).all(axis=(0, 2)) & (basis >= 0).all(axis=(0, 2))
    usable &= basis[0].sum(axis=-1) > 0
    noise = f"{kind} {amount:g}" if amount else kind
    rows = []
    for name in [*SUPPORTS, "search"]:
        begun = time.perf_counter()
        moments = Moments.from_basis(basis, patterns, extent)
        support = SUPPORTS.get(name, BOX)
        if name == "search":
            clear = np.where(usable[None, :, None], basis, 0)
            parameters = search(clear, patterns, extent, 1, follow=False)
        else:
            parameters = support.fit(moments)
        seconds = time.perf_counter() - begun
        outside = ~(np.isfinite(parameters) & (parameters >= 0) & (parameters <= 1))
        invalid = outside.any(axis=-1)
        errors = []
        for lit in lights.values():
            radiance = lit.binned[PATCH, ..., :3] / lit.binned[PATCH, ..., 3:]
            truth = np.einsum("nij,ijc->nc", transport, radiance)
            found = support.average(lit, PATCH, np.where(outside, 0.5, parameters))
            invalid |= ~np.isfinite(found).all(axis=-1)
            errors.append(np.abs(found - truth) / (truth + 0.01 * truth.mean()))
        place = _fitted_place(name, parameters, moments)
        support_error = None
        if place is not None and usable.any():
            support_error = float(np.abs(place - _place(m))[:, usable].mean())
        # the median over pixels: beside a sun the mean is that of the few that miss it
        relit = np.median(np.stack(errors)[:, usable], axis=(1, 2)) if usable.any() else None
        rows.append(
            {
                "case": case,
                "model": name,
                "noise": noise,
                "support_error": support_error,
                "relit_error": None if relit is None else float(relit.mean()),
                "invalid_share": float(invalid.mean()),
                "seconds": seconds,
            }
        )
    return rows


def stability() -> list[dict[str, Any]]:
    """Every case with every kind of noise: rows for the JSON."""
    lights = environments()
    patterns = PATTERN_SETS["moments_uv"]
    return [
        row
        for case in CASES
        for kind, amount in DAMAGE
        for row in run_case(case, kind, amount, lights, patterns)
    ]


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown: error in the relit pixel by case and model without noise, and by noise."""
    models = list(dict.fromkeys(r["model"] for r in rows))

    def block(title: str, key: str, pick: Callable[[dict[str, Any]], bool]) -> list[str]:
        chosen = [r for r in rows if pick(r)]
        out = [f"| {title} | " + " | ".join(models) + " |", "|---" * (len(models) + 1) + "|"]
        for name in dict.fromkeys(r[key] for r in chosen):
            cells = []
            for model in models:
                values = [
                    r["relit_error"]
                    for r in chosen
                    if r[key] == name and r["model"] == model and r["relit_error"] is not None
                ]
                cells.append(f"{np.mean(values):.3f}" if values else "")
            out.append(f"| {name} | " + " | ".join(cells) + " |")
        return out

    lines = block("case, no noise", "case", lambda r: r["noise"] == "none")
    lines += ["", *block("noise, mean of all cases", "noise", lambda r: True)]
    invalid = sum(r["invalid_share"] for r in rows)
    lines += ["", f"Entries outside their patch or not finite: {invalid:.0f} of all."]
    return "\n".join(lines)
