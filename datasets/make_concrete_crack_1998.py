"""Make `concrete_crack_1998.nc`: a synthetic face with the dimension and the dilatancy that the paper states.

A self-affine face (Hurst exponent 0.73, roll-off at 12 mm, 0.3 mm rms), a mean plane that rises towards E and
S, and three pores with walls 0.8 mm wide and 1.85 mm deep, the "localized discontinuities" of the paper: the
opposite face fills them, and must climb out before the block slides freely. By four methods the dimension is
2.16 to 2.29, and the rigid dilatancy is 2 mm at 0.8 mm of shear. Towards W and N it then stays within 25 %,
towards E and S it goes on with the mean slope. The seed was chosen for that among twenty: the later part of
these curves depends on single asperities. Heights are drawn on a grid four times finer than the one that is
kept, and rounded to 2 um, the precision of the scanner.

    python datasets/make_concrete_crack_1998.py       writes the file beside this script
"""

from pathlib import Path

import numpy as np

import fractalcontact as fc

POINTS, SPACING = 512, 80e-6  # m
FINER = 4  # points drawn for each one kept
HURST, ROLLOFF, RMS_HEIGHT = 0.73, 12e-3, 0.3e-3
SLOPE_X, SLOPE_Y = 0.08, -0.08
PRECISION = 2e-6
PORES = ((13.4, 14.2), (24.3, 12.6), (18.6, 19.8))  # x, y in mm
DEPTH, FLOOR, WALL = 1.85e-3, 0.25e-3, 0.8e-3  # of a pore; radius of its floor, width of its wall
SEED = 23


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
    heights *= RMS_HEIGHT / heights.std()
    x = (np.arange(POINTS) + 0.5) * SPACING
    heights += SLOPE_X * x + SLOPE_Y * x[:, None]
    for place_x, place_y in 1e-3 * np.array(PORES):
        distance = np.hypot(x - place_x, x[:, None] - place_y)
        share = np.clip((FLOOR + WALL - distance) / WALL, 0.0, 1.0)
        heights -= DEPTH * share**2 * (3.0 - 2.0 * share)
    heights -= heights.mean()
    return fc.surfaces.from_array(PRECISION * np.rint(heights / PRECISION), SPACING)


def main():
    """Write the face, packed in steps of the scanner's precision."""
    face = crack()
    face.attrs["title"] = "synthetic concrete crack face with the dilatancy of the 1998 paper"
    face.encoding.update(dtype="int16", scale_factor=PRECISION, _FillValue=np.int16(-32768))
    print(fc.save(face, Path(__file__).with_name("concrete_crack_1998.nc")).name, float(face.std()), "m rms")


if __name__ == "__main__":
    main()
