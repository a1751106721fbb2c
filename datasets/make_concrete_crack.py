"""Make `concrete_crack.nc`: a synthetic face with the statistics of the scanned one of the paper.

A self-affine face of fractal dimension 2.22 (Hurst exponent 0.78) up to a roll-off at 12 mm, beyond which the
heights are no longer correlated; a mean plane that falls towards W and N, so that sliding E and S climbs it;
and a few pores in the cement paste, which both faces carry and which decide how far the block must rise
before it slides freely. It is drawn on a grid four times finer than the one that is kept, because points
scanned 80 um apart do not resolve shorter waves. Heights are rounded to 2 um, the precision of the scanner.

    python datasets/make_concrete_crack.py            writes the file beside this script
"""

from pathlib import Path

import numpy as np

import fractalcontact as fc

POINTS, SPACING = 512, 80e-6  # m
FINER = 4  # points drawn for each one kept
HURST, ROLLOFF, RMS_HEIGHT = 0.78, 12e-3, 0.2e-3
SLOPE_X, SLOPE_Y = 0.03, -0.03
PRECISION = 2e-6
PORES = (  # x, y, radius and depth in mm
    (16.5, 18.8, 1.1, 0.36),
    (24.8, 23.1, 0.8, 0.3),
    (20.5, 27.2, 1.4, 0.42),
    (8.5, 31.2, 1.2, 0.33),
    (33.5, 9.8, 1.0, 0.27),
)
SEED = 11


def crack():
    """Return the face as `height` (y, x) in metres, free at its edges."""
    margin = POINTS // 4  # cut away, so that opposite edges do not match
    drawn = fc.surfaces.spectral(
        (FINER * (POINTS + margin),) * 2,
        SPACING / FINER,
        hurst=HURST,
        rolloff=ROLLOFF,
        rms_height=RMS_HEIGHT,
        rng=SEED,
    )
    heights = drawn.values[: FINER * POINTS : FINER, : FINER * POINTS : FINER].copy()
    x = (np.arange(POINTS) + 0.5) * SPACING
    heights += SLOPE_X * x + SLOPE_Y * x[:, None]
    for place_x, place_y, radius, depth in 1e-3 * np.array(PORES):
        distance = np.hypot(x - place_x, x[:, None] - place_y)
        heights -= np.where(distance < radius, depth * np.cos(0.5 * np.pi * distance / radius) ** 2, 0.0)
    heights -= heights.mean()
    return fc.surfaces.from_array(PRECISION * np.rint(heights / PRECISION), SPACING)


def main():
    """Write the face, packed in steps of the scanner's precision."""
    face = crack()
    face.attrs["title"] = "synthetic concrete crack face"
    face.encoding.update(dtype="int16", scale_factor=PRECISION, _FillValue=np.int16(-32768))
    print(fc.save(face, Path(__file__).with_name("concrete_crack.nc")).name, float(face.std()), "m rms")


if __name__ == "__main__":
    main()
