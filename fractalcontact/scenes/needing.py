"""What the stages of a scene need at the least: libraries, and the files of their kernels.

The table says it once, by the words of `[want]` and by the way the face is given; which stages there are is
told by the plan. What a library brings along is found by loading it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from fractalcontact.base import fft
from fractalcontact.scenes.planning import FIGURES, Stage, stages_of
from fractalcontact.scenes.scene import Scene

RUN = ("lazy_loader", "numpy", "xarray", "netCDF4")
COMPILER = ("numba", "scipy.linalg")
FFT = "transforms"  # the library that does them


@dataclass(frozen=True)
class Need:
    """Libraries to be loaded, and files of kernels out of which some are compiled."""

    libraries: tuple[str, ...] = ()
    kernels: tuple[str, ...] = ()


_PRESSED = Need((FFT, "scipy.special"), ("contact._kernels",))
_SUMS = Need((FFT,), ("dimensions._kernels",))
_EXACT = Need((FFT, "scipy.special"), _SUMS.kernels)
_LABELS = ("scipy.ndimage", "scipy.special")
_COVERS = ("domains._kernels", "domains._mean_kernels")
_ALL_MEASURES = (
    *_COVERS,
    "domains._near_kernels",
    "domains._edge_kernels",
    "domains._gliding_kernels",
    "domains._island_kernels",
)
_SPECIAL = ("scipy.special",)

NEEDS: Mapping[str, Need] = {
    "generate/fbm": Need((FFT,)),
    "generate/spectral": Need((FFT,)),
    "sample/jacksboro_fault_dem": Need(("matplotlib.cbook",)),
    "prepare/despike": Need(_SPECIAL),
    "prepare/fill": Need(("scipy.sparse.linalg",)),
    "dimensions/default": _EXACT,
    "dimensions/likelihood": _EXACT,
    "dimensions/increments": _EXACT,
    "dimensions/spectrum": Need((FFT,)),
    "dimensions/variogram": Need((FFT,)),
    "dimensions/madogram": _SUMS,
    "dimensions/second_variogram": _SUMS,
    "dimensions/roughness_length": Need((FFT, "scipy.optimize"), _SUMS.kernels),
    "dimensions/cube_counts": Need((FFT,)),
    "dimensions/covering": _SUMS,
    "dimensions/variation": Need((FFT,)),
    "contact": _PRESSED,
    # the registration of scikit-image has scipy's transforms of its own
    "joints/register": Need((FFT, "skimage.registration", "scipy.ndimage", "scipy.fft")),
    "joints/closure": _PRESSED,
    "joints/elastic_dilatancy": _PRESSED,
    "joints/transmissivity": Need(("scipy.sparse.linalg", "scipy.sparse.csgraph")),
    "domains/box_dimension": Need(_SPECIAL, _COVERS),
    "domains/box_counts": Need(_SPECIAL, ("domains._mean_kernels",)),
    "domains/box_counts/minimum": Need((), ("domains._kernels",)),
    "domains/minkowski_dimension": Need(_SPECIAL, ("domains._near_kernels",)),
    "domains/correlation_dimension": Need((FFT, *_SPECIAL)),
    "domains/generalised_dimensions": Need(_SPECIAL),
    "domains/boundary_dimension": Need(_SPECIAL, ("domains._edge_kernels",)),
    "domains/lacunarity": Need((), ("domains._gliding_kernels",)),
    "domains/islands": Need(_LABELS, ("domains._island_kernels",)),
    "domains/percolation": Need(_LABELS, ("domains._island_kernels",)),
    "domains/describe": Need(_LABELS, _ALL_MEASURES),
    "domains/evolution": Need((*_LABELS, "scipy.spatial"), _ALL_MEASURES),
    "domains/lineage": Need((*_LABELS, "scipy.spatial"), ("domains._island_kernels",)),
    FIGURES: Need(("matplotlib.figure", "matplotlib.backends.backend_agg")),
}


def least(scene: Scene) -> Need:
    """Return what the wanted results of a scene need, whoever plans it."""
    needs = [NEEDS[word] for word in _words(scene) if word in NEEDS]
    libraries = dict.fromkeys([*RUN, *(name for one in needs for name in one.libraries)])
    kernels = tuple(dict.fromkeys(name for one in needs for name in one.kernels))
    if FFT in libraries:
        del libraries[FFT]
        libraries["scipy.fft" if fft.library() == "scipy" else fft.library()] = None
    return Need((*libraries, *(COMPILER if kernels else ())), kernels)


def least_stages(scene: Scene) -> set[str]:
    """Return the stages that the wanted words name, and those that these need."""
    planned = {stage.name: stage for stage in stages_of(scene)}
    found: set[str] = set()
    left = [name for name, stage in planned.items() if _wanted(stage, scene)]
    while left:
        name = left.pop()
        if name not in found:
            found.add(name)
            left += planned[name].needs
    return found


def _wanted(stage: Stage, scene: Scene) -> bool:
    """Whether the words of `[want]` name the stage, or its figures show it."""
    room, _, name = stage.name.partition("/")
    if stage.name == FIGURES:
        return True
    if stage.name == "surfaces":
        return "height" in scene.wanted(room)
    words = {"description": "describe"}.get(name, name)
    return words in scene.wanted(room) if name else bool(scene.wanted(room))


def _words(scene: Scene) -> Iterator[str]:
    for name in ("surface", "upper"):
        table = scene.table(name)
        yield f"generate/{table.get('generate')}"
        yield f"sample/{table.get('sample')}"
        yield from (f"prepare/{key}" for key in ("despike", "fill") if table.get(key))
    yield from (f"dimensions/{word}" for word in scene.wanted("dimensions"))
    yield from least_stages(scene)
    if "box_counts" in scene.wanted("domains"):
        yield f"domains/box_counts/{scene.table('domains').get('box_counts', {}).get('cover')}"
    if scene.registers:
        yield "joints/register"
