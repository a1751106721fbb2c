"""Masks read from images: photographs of stained contacts, pressure films, segmented micrographs."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.errors import UnreadableFile
from fractalcontact.base.grid import DECADES, plane_coords
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.provenance import file_checksum
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems, reading


def _check(problems: Problems) -> None:
    given = problems.given
    problems.file("path")
    if problems.numbers("spacing", above=0, at_most=10.0**DECADES):
        size = float_array(given.spacing).size
        problems.require(size in (1, 2), "spacing", "one number or (y, x)", f"{size} numbers")
    problems.number("threshold", optional=True)
    problems.boolean("dark")


@public_result(
    title="Mask read from an image",
    references="Otsu, IEEE Trans. Systems, Man, and Cybernetics 9:62 (1979) (threshold)",
    achieved_error="exact",
    check=_check,
)
def read_mask(
    path: str | os.PathLike[str],
    spacing: float | tuple[float, float],
    *,
    threshold: float | None = None,
    dark: bool = False,
) -> xr.DataArray:
    """Read a mask from an image file (PNG, TIFF, JPEG and others).

    Parameters
    ----------
    path : path
        The image. Colours are converted to grey values of their range; opacity is ignored.
    spacing : float, or (y, x)
        Edge of a pixel in metres.
    threshold : float, optional
        Pixels with a larger grey value belong to the set. By default half-way between the two values of a
        two-valued image, and Otsu's threshold for any other.
    dark : bool
        Dark pixels belong to the set, at or below the threshold: for stains and pressure films.

    Returns
    -------
    DataArray of bool, dims (y, x)
        `mask`, with y upwards: the first row of the image, upright as viewers show it, is the last of the
        mask. The provenance has the threshold and the number of distinct grey values.

    Raises
    ------
    InvalidInput
        The file does not exist or an argument is out of range.
    UnreadableFile
        The file is no image, holds several images, or has only one grey value and no threshold is given.

    References
    ----------
    Otsu (1979), IEEE Transactions on Systems, Man, and Cybernetics 9:62.

    Examples
    --------
    >>> import fractalcontact as fc, numpy as np, skimage as ski, tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "film.png"
    >>> ski.io.imsave(path, np.uint8([[0, 255, 255], [0, 0, 255]]), check_contrast=False)
    >>> mask = fc.domains.read_mask(path, 1e-4)
    >>> mask.values.astype(int).tolist()
    [[0, 0, 1], [0, 1, 1]]
    """
    grey = _grey_values(Path(path))
    levels = np.unique(grey)
    if threshold is None:
        threshold = _threshold(grey, levels, Path(path).name)
    cells = (grey <= threshold if dark else grey > threshold)[::-1]
    step = np.broadcast_to(float_array(spacing), 2).tolist()
    coords = plane_coords(cells.shape, step, (False, False))
    facts: dict[str, Any] = {"threshold": float(threshold), "grey_values": int(levels.size)}
    facts |= {"file_sha256": file_checksum(Path(path)), "parameters": {"path": Path(path).name}}
    return xr.DataArray(np.ascontiguousarray(cells), coords, ("y", "x"), name="mask", attrs=facts)


def _grey_values(path: Path) -> Array:
    """Return the grey values (ny, nx) of an image, upright as viewers show it."""
    from PIL import Image, ImageOps
    from skimage.color import rgb2gray

    with reading("fractalcontact.domains.read_mask", path):
        content = path.read_bytes()
    try:
        with Image.open(io.BytesIO(content)) as file:
            # beside a photograph a telephone may store its preview and its depth (MPO)
            count = 1 if file.format == "MPO" else int(getattr(file, "n_frames", 1))
            picture = ImageOps.exif_transpose(file)  # a camera states how it was held
            if picture.mode == "LA":  # grey value and opacity
                picture = picture.convert("L")
            elif picture.mode not in ("1", "L", "F") and not picture.mode.startswith("I"):
                picture = picture.convert("RGB")  # also from a palette, or from inks
            image = np.asarray(picture)
    except Exception as error:  # Pillow raises exceptions of many kinds
        raise UnreadableFile(path.name, [f"path: expected an image, got {type(error).__name__}"]) from error
    if count != 1:
        raise UnreadableFile(path.name, [f"path: expected one image, got {count}"])
    if image.ndim == 3:
        image = 255.0 * rgb2gray(image)  # as those of a grey image
    if not np.isfinite(image).all():
        raise UnreadableFile(path.name, ["path: expected finite grey values, got some that are not"])
    return image.astype(np.float64)


def _threshold(grey: Array, levels: Array, name: str) -> float:
    """Return the grey value that separates the set from the rest."""
    from skimage.filters import threshold_otsu

    if levels.size < 2:
        message = f"threshold: expected a number for an image of one grey value ({levels[0]:g}), got None"
        raise UnreadableFile(name, [message])
    return float(levels.mean()) if levels.size == 2 else float(threshold_otsu(grey))
