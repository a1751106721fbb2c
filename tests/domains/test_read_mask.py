"""Masks from image files: orientation, thresholds, and files that are no images."""

import json

import numpy as np
import pytest
import skimage as ski
from PIL import Image

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput, UnreadableFile

CELLS = np.random.default_rng(4).random((20, 30)) < 0.3


def write(path, image):
    ski.io.imsave(path, image, check_contrast=False)
    return path


@pytest.mark.parametrize("suffix", ["png", "tif", "bmp"])
def test_mask_comes_back_from_an_image(tmp_path, suffix):
    path = write(tmp_path / f"mask.{suffix}", np.uint8(255 * CELLS))
    mask = fc.domains.read_mask(path, (2e-4, 1e-4))
    np.testing.assert_array_equal(mask.values[::-1], CELLS)
    assert mask.dtype == bool
    assert mask.y.values[0] == pytest.approx(1e-4)
    assert float(mask.x[1] - mask.x[0]) == pytest.approx(1e-4)
    assert float(fc.domains.describe(mask).coverage) == pytest.approx(CELLS.mean())


def test_dark_pixels_are_the_complement(tmp_path):
    path = write(tmp_path / "film.png", np.uint8(255 * CELLS))
    bright, dark = (fc.domains.read_mask(path, 1e-4, dark=dark) for dark in (False, True))
    np.testing.assert_array_equal(dark.values, ~bright.values)


def test_colour_and_opacity(tmp_path):
    colour = np.zeros((*CELLS.shape, 4), np.uint8)
    colour[CELLS, 1], colour[..., 3] = 200, 255
    mask = fc.domains.read_mask(write(tmp_path / "colour.png", colour), 1e-4)
    np.testing.assert_array_equal(mask.values[::-1], CELLS)


def test_otsu_separates_two_noisy_levels(tmp_path):
    noise = np.random.default_rng(5).normal(scale=12.0, size=CELLS.shape)
    image = np.uint8(np.clip(60 + 120 * CELLS + noise, 0, 255))
    path = write(tmp_path / "noisy.png", image)
    mask = fc.domains.read_mask(path, 1e-4)
    np.testing.assert_array_equal(mask.values[::-1], CELLS)
    threshold = json.loads(mask.attrs["provenance"])["threshold"]
    np.testing.assert_array_equal(fc.domains.read_mask(path, 1e-4, threshold=threshold), mask)


def test_one_grey_value_needs_a_threshold(tmp_path):
    path = write(tmp_path / "blank.png", np.full((5, 5), 7, np.uint8))
    with pytest.raises(UnreadableFile, match="threshold: expected a number"):
        fc.domains.read_mask(path, 1e-4)
    assert not fc.domains.read_mask(path, 1e-4, threshold=7).values.any()


def test_wrong_arguments_are_listed_together(tmp_path):
    with pytest.raises(InvalidInput) as caught:
        fc.domains.read_mask(tmp_path / "none.png", -1.0, threshold="x", dark=2)
    assert len(caught.value.problems) == 4


def test_file_that_is_no_image(tmp_path):
    (tmp_path / "text.png").write_text("no image")
    with pytest.raises(UnreadableFile, match="expected an image"):
        fc.domains.read_mask(tmp_path / "text.png", 1e-4)


@pytest.mark.parametrize("suffix", [".jpg", ".tif"])
def test_inks_are_dark_where_they_are_large(tmp_path, suffix):
    """A picture made for print (CMYK) was taken for colours with opacity: its set was the complement."""
    mask = np.zeros((40, 60), dtype=bool)
    mask[8:24, 16:40] = True
    picture = Image.fromarray(np.where(mask, 255, 0).astype(np.uint8)).convert("RGB").convert("CMYK")
    picture.save(tmp_path / f"print{suffix}")
    read = fc.domains.read_mask(tmp_path / f"print{suffix}", 1e-4)
    np.testing.assert_array_equal(read.values[::-1], mask)


def test_one_image_of_any_mode_and_no_more(tmp_path):
    grey = Image.fromarray(np.uint8(255 * CELLS))
    for name, image in {
        "palette.gif": grey,
        "palette.png": grey.convert("P"),
        "opacity.png": grey.convert("LA"),
        "bits.tif": grey.convert("1"),
        "long.png": Image.fromarray(np.uint16(60000 * CELLS)),
    }.items():
        image.save(tmp_path / name)
        np.testing.assert_array_equal(fc.domains.read_mask(tmp_path / name, 1e-4).values[::-1], CELLS)
    for name in ("pages.tif", "frames.gif"):
        grey.save(tmp_path / name, save_all=True, append_images=[Image.fromarray(np.uint8(255 * ~CELLS))])
        with pytest.raises(UnreadableFile, match="expected one image, got 2"):
            fc.domains.read_mask(tmp_path / name, 1e-4)
    large = np.kron(CELLS, np.ones((8, 8), bool))
    photo, preview = Image.fromarray(np.uint8(255 * large)), Image.new("L", (8, 8))
    photo.save(tmp_path / "photo.jpg", "MPO", save_all=True, append_images=[preview], quality=95)
    mask = fc.domains.read_mask(tmp_path / "photo.jpg", 1e-4, threshold=128)
    np.testing.assert_array_equal(mask.values[::-1], large)


@pytest.mark.parametrize("suffix", ["jpg", "png", "tif"])
def test_picture_of_a_turned_camera_is_upright(tmp_path, suffix):
    """Orientation 6: the first row of the file is the right side of the picture."""
    cells, orientation = np.kron(CELLS, np.ones((8, 8), bool)), Image.Exif()
    orientation[0x0112] = 6
    turned = Image.fromarray(np.uint8(255 * np.rot90(cells)))
    turned.save(tmp_path / f"photo.{suffix}", exif=orientation)
    mask = fc.domains.read_mask(tmp_path / f"photo.{suffix}", 1e-4, threshold=128)
    np.testing.assert_array_equal(mask.values[::-1], cells)


def test_a_threshold_is_a_grey_value_of_the_file(tmp_path):
    grey = np.array([[0, 100, 200], [50, 150, 250]], dtype=np.uint8)
    ski.io.imsave(tmp_path / "grey.png", grey, check_contrast=False)
    ski.io.imsave(tmp_path / "colour.png", np.stack([grey] * 3, axis=-1), check_contrast=False)
    masks = [
        fc.domains.read_mask(tmp_path / name, 1e-4, threshold=128) for name in ("grey.png", "colour.png")
    ]
    np.testing.assert_array_equal(masks[0], masks[1])
    assert masks[0].values.sum() == 3


def test_missing_grey_values_are_refused(tmp_path):
    ski.io.imsave(tmp_path / "gap.tif", np.array([[0.0, np.nan], [1.0, 2.0]], dtype=np.float32))
    with pytest.raises(UnreadableFile, match="finite grey values"):
        fc.domains.read_mask(tmp_path / "gap.tif", 1e-4)
