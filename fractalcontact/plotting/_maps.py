"""Maps of planes: shaded heights, fields, contact states, with colour bar and scale bar."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.units import Scale, quantity_text
from fractalcontact.plotting import _style
from fractalcontact.plotting._units import label_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = np.ndarray[Any, np.dtype[Any]]
Extent = tuple[float, float, float, float]

MOST_CELLS = 1600  # along an edge; a finer plane is averaged first, since no screen shows more
SHADED_SLOPE = 0.5  # rms slope after the exaggeration of the shading
SHADING = 0.9  # change of brightness from no light to full light
CLIPPED = 0.2  # per cent of the values at either end that may lie outside the colour bar


def block_means(plane: Array, most: int = MOST_CELLS) -> Array:
    """Return means over blocks of cells, so that no edge has more than `most` cells."""
    by, bx = (-(-n // most) for n in plane.shape)
    if by == bx == 1:
        return plane
    ny, nx = plane.shape[0] // by * by, plane.shape[1] // bx * bx
    means: Array = plane[:ny, :nx].reshape(ny // by, by, nx // bx, bx).mean(axis=(1, 3))
    return means


def colour_limits(values: Array, clipped: float = CLIPPED) -> tuple[float, float, str]:
    """Return the ends of a colour scale, and which ends (`neither`, `min`, `max`, `both`) are exceeded."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0, 1.0, "neither"
    lowest, highest = float(finite.min()), float(finite.max())
    low, high = (float(v) for v in np.percentile(finite, (clipped, 100 - clipped)))
    # a tail that adds little to the range is shown; one that would flatten everything else is cut
    low = lowest if low - lowest <= 0.25 * (high - low) else low
    high = highest if highest - high <= 0.25 * (high - low) else high
    if not high > low:
        width = abs(high) * 1e-6 or 1.0
        return low - width, high + width, "neither"
    beyond = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}
    return low, high, beyond[lowest < low, highest > high]


def relief(
    ax: Axes, heights: Array, extent: Extent, length: Scale, height: Scale, *, shaded: bool = False
) -> Any:
    """Draw heights (m), if wanted lit from the north-west; return the mappable of a colour bar."""
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LightSource, Normalize

    heights = block_means(heights)
    low, high, beyond = colour_limits(heights)
    norm, colours = (
        Normalize(float(height(low)), float(height(high))),
        matplotlib.colormaps[_style.HEIGHT_MAP],
    )
    missing = ~np.isfinite(heights)
    filled = np.where(missing, low, heights)
    image = colours(norm(height(filled)))[..., :3]
    if shaded:
        spacing = (extent[3] - extent[2]) / heights.shape[0], (extent[1] - extent[0]) / heights.shape[1]
        light = _light(LightSource(azdeg=315, altdeg=45), filled, spacing)
        image = np.clip(image * (1.0 + SHADING * (light - light.mean()))[..., None], 0.0, 1.0)
    image[missing] = matplotlib.colors.to_rgb(_style.MISSING)
    draw_image(ax, image, extent, length)
    mappable = ScalarMappable(norm, colours)
    mappable.beyond = beyond  # type: ignore[attr-defined]
    return mappable


def _light(source: Any, heights: Array, spacing: tuple[float, float]) -> Array:
    """Return the illumination of each cell, 0 to 1, with slopes scaled to an rms of `SHADED_SLOPE`."""
    if min(heights.shape) < 2:
        return np.full(heights.shape, 0.75)
    slopes = np.gradient(heights, *spacing)
    steep = float(np.sqrt(np.mean(slopes[0] ** 2 + slopes[1] ** 2)))
    if not steep > 0 or not np.isfinite(steep):
        return np.full(heights.shape, 0.75)
    # row 0 is the south edge, whereas LightSource counts rows from the north
    normal = np.stack([-slopes[1], -slopes[0]], axis=-1) * (SHADED_SLOPE / steep)
    lit = (normal @ source.direction[:2] + source.direction[2]) / np.sqrt(1 + (normal**2).sum(axis=-1))
    clipped: Array = np.clip(np.asarray(lit), 0.0, 1.0)
    return clipped


def field(ax: Axes, values: Array, extent: Extent, length: Scale, shown: Scale, *, positive: bool) -> Any:
    """Draw a field; with `positive`, zero cells are left pale. Return the mappable of a colour bar."""
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    values = block_means(np.where(values > 0, values, 0.0) if positive else values)
    low, high, beyond = colour_limits(
        values[values > 0] if positive else values, clipped=1.0 if positive else CLIPPED
    )
    norm, colours = (
        Normalize(float(shown(0.0 if positive else low)), float(shown(high))),
        matplotlib.colormaps[_style.FIELD_MAP],
    )
    missing = ~np.isfinite(values)
    image = colours(norm(shown(np.where(missing, low, values))))[..., :3]
    if positive:
        image[values == 0] = matplotlib.colors.to_rgb(_style.STATE_COLOURS[0])
    image[missing] = matplotlib.colors.to_rgb(_style.MISSING)
    draw_image(ax, image, extent, length)
    mappable = ScalarMappable(norm, colours)
    mappable.beyond = "max" if positive and beyond in ("max", "both") else "neither" if positive else beyond  # type: ignore[attr-defined]
    return mappable


def state(
    ax: Axes,
    flags: Array,
    extent: Extent,
    length: Scale,
    colours: Sequence[str] = _style.STATE_COLOURS,
) -> None:
    """Draw the flags of a contact (0, 1, 2; or a boolean mask), each in its colour."""
    import matplotlib

    palette = np.array([matplotlib.colors.to_rgb(colour) for colour in colours])
    draw_image(ax, palette[np.clip(np.asarray(flags).astype(np.int64), 0, 2)], extent, length)
    bare_frame(ax)


def draw_image(ax: Axes, image: Array, extent: Extent, length: Scale) -> None:
    """Draw an RGB image with its first row at the bottom and equal axes."""
    left, right, bottom, top = (float(v) for v in length(extent))
    ax.imshow(image, origin="lower", extent=(left, right, bottom, top), aspect="equal")
    _style.draw_frame(ax)


def colour_bar(ax: Axes, mappable: Any, name: str, scale: Scale) -> Any:
    """Add a narrow colour bar beside the axes."""
    bar: Any = ax.get_figure().colorbar(  # type: ignore[union-attr]
        mappable, ax=ax, extend=mappable.beyond, aspect=28, shrink=0.85, pad=0.02
    )
    bar.outline.set_linewidth(0.5)
    _style.style_axes(bar.ax)
    bar.ax.grid(False)
    label_axis(bar.ax.yaxis, name, scale)
    bar.ax.tick_params(length=2.5)
    return bar


def flag_legend(axes: Any, sheet: Any, words: Sequence[str], colours: Sequence[str]) -> None:
    """Put the key of the colours of flags below all panels of a figure, or beside the last of those given."""
    from matplotlib.patches import Patch

    entries = [
        Patch(facecolor=colour, edgecolor=_style.grey(), linewidth=0.4, label=word)
        for colour, word in zip(colours, words, strict=True)
    ]
    if sheet is None:
        _style.side_legend(axes[-1], entries)
    else:
        sheet.legend(handles=entries, loc="outside lower right", ncols=3)


def bare_frame(ax: Axes) -> None:
    """Remove ticks and draw a thin frame."""
    ax.set_xticks([])
    ax.set_yticks([])
    _style.draw_frame(ax, _style.grey())


def scale_bar(ax: Axes, extent: Extent, length: Scale) -> None:
    """Draw a scale bar of a round length below a map."""
    width = extent[1] - extent[0]
    size = round_length(width / 4)
    start = float(length(extent[0]))
    end, transform = float(length(extent[0] + size)), ax.get_xaxis_transform()
    ax.plot([start, end], [-0.045, -0.045], color=_style.ink(), lw=1.6, solid_capstyle="butt",
            transform=transform, clip_on=False)  # fmt: skip
    ax.text(
        end + 0.02 * float(length(width)),
        -0.045,
        quantity_text(size, "m"),
        transform=transform,
        va="center",
        fontsize="small",
    )


def round_length(length: float) -> float:
    """Return the largest 1, 2 or 5 times a power of ten that is no longer than `length`."""
    if not length > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(m for m in (1, 2, 5) if m * power <= length * (1 + 1e-9)))
