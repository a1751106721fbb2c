"""Box dimension and local slopes beside their random null."""

import numpy as np
import plotting_synthetic as synthetic
import pytest
import xarray as xr
from plotting_figures import factor, holds

import fractalcontact as fc
from fractalcontact import plotting


@pytest.fixture
def closed():
    return synthetic.closure(synthetic.delta(synthetic.heights(), shears=(8e-4, 1.6e-3, 8e-3)))


def test_null_and_interval(closed):
    result = synthetic.box_dimension(closed)
    by_load, by_shear = plotting.box_dimension(result)

    def lines(ax):
        fx = factor(ax.get_xlabel())
        return [np.array([np.asarray(line.get_xdata()) * fx, line.get_ydata()]) for line in ax.lines]

    for name in ("box_dimension", "null_dimension"):
        for v in result.shear:
            assert holds(lines(by_load), result.normal_force, result[name].sel(shear=v))
        assert holds(lines(by_shear), result.shear, result[name].isel(step=-1))
    assert not by_load.collections  # six overlapping bands would be illegible
    low, high = (result[name].isel(step=-1) for name in ("ci_low", "ci_high"))
    band = by_shear.collections[0].get_paths()[0].vertices[:, 1]
    assert band.min() == pytest.approx(float(low.min()))
    assert band.max() == pytest.approx(float(high.max()))


def test_an_interval_is_shaded_on_a_path_that_turns_back(closed):
    """One outline, run through to and fro, encloses nothing."""
    there_and_back = synthetic.box_dimension(closed).isel(shear=0, step=[0, 1, 2, 1])
    (ax,) = plotting.box_dimension(there_and_back)
    force = np.mean(ax.lines[0].get_xdata()[1:3])  # between the states that are passed twice
    low, high = (float(there_and_back[name][1:3].mean()) for name in ("ci_low", "ci_high"))
    bands = [path for each in ax.collections for path in each.get_paths()]
    place = (force, (low + high) / 2)
    assert sum(abs(_turns(path.vertices, place)) for path in bands) == 2
    assert all(abs(_turns(path.vertices, place)) <= 1 for path in bands)


def _turns(outline, place):
    """Return how often an outline goes around a place."""
    angles = np.unwrap(np.arctan2(*(outline - place).T[::-1]))
    return round((angles[-1] - angles[0]) / (2 * np.pi))


def test_chosen_force(closed):
    result = synthetic.box_dimension(closed)
    ax = plotting.box_dimension(result, normal_force=1e3)[1]
    assert np.allclose(ax.lines[0].get_ydata(), result.box_dimension.sel(step=2))
    assert "1 kN" in ax.get_title(loc="left")


def test_wide_or_missing_interval_is_open_point(closed):
    result = synthetic.box_dimension(closed).isel(shear=0, step=slice(1, None)).copy(deep=True)
    result["ci_high"].values[0] += 0.6
    result["ci_low"].values[1] = np.nan
    (ax,) = plotting.box_dimension(result)
    _, filled, hollow, _ = ax.lines
    assert hollow.get_markerfacecolor() == ax.get_facecolor()
    assert np.array_equal(hollow.get_ydata(), result.box_dimension.values[:2])
    assert np.array_equal(filled.get_ydata(), result.box_dimension.values[2:])
    assert len(ax.collections) == 1


def test_minkowski_dimension():
    result = xr.Dataset(
        {
            "minkowski_dimension": ("step", np.array([0.5, 1.5])),
            "null_dimension": ("step", np.array([0.2, 1.0])),
        },
        coords={"normal_force": ("step", np.array([1.0, 2.0]), {"units": "N"})},
    )
    (ax,) = plotting.box_dimension(result)
    assert ax.lines[0].get_ydata() == pytest.approx([0.5, 1.5])
    assert "inkowski" in ax.get_ylabel()
    empty = result.assign(minkowski_dimension=result["minkowski_dimension"] * np.nan)
    assert plotting.box_dimension(empty)[0].texts[0].get_text() == "no contact"


def test_local_slopes_and_null():
    sizes = np.array([1, 2, 4, 8])
    count = 64.0 * sizes[None, :] ** -np.array([[1.2], [1.5]])
    null = 64.0 * sizes[None, :] ** -np.array([[0.5], [1.0]])
    result = xr.Dataset(
        {
            "local_slope": (("step", "box_size"), np.array([[1.2] * 4, [1.5] * 4])),
            "box_count": (("step", "box_size"), count),
            "null_count": (("step", "box_size"), null),
        },
        coords={"box_size": sizes, "box_length": ("box_size", sizes * 1e-3, {"units": "m"})},
    )
    (ax,) = plotting.signature(result)
    lines = {line.get_label(): line.get_ydata() for line in ax.lines}
    wanted = {"contact domain, step = 0": 1.2, "random null, step = 0": 0.5,
              "contact domain, step = 1": 1.5, "random null, step = 1": 1.0}  # fmt: skip
    assert set(lines) == set(wanted)
    for name, want in wanted.items():
        assert lines[name] == pytest.approx(np.full(4, want))
    low, high = ax.get_ylim()
    assert low < 0
    assert high > 2
    steep = result.assign(local_slope=result["local_slope"] * [[1.0, 1.0, 3.5, -1.0]])
    (ax,) = plotting.signature(steep.assign_coords(shear=("shear", [1e-3], {"units": "m"})))
    assert ax.get_ylim() == pytest.approx((-0.05, 2.05))  # no dimension is beyond 0 ... 2
    assert ax.texts[0].get_text().endswith("-1.5 to 5.2")
    ax.figure.draw_without_rendering()
    (title,) = ax.findobj(lambda each: getattr(each, "get_text", str)() == "$v$ = 1 mm")
    assert not title.get_window_extent().overlaps(ax.texts[0].get_window_extent())


def test_described_dimension_has_its_interval_and_open_points(closed):
    result = synthetic.box_dimension(closed).isel(shear=0).copy(deep=True)
    result["ci_high"].values[0] += 0.6
    described = result.rename(ci_low="box_dimension_low", ci_high="box_dimension_high")
    (alone,), (ax,) = plotting.box_dimension(result), plotting.box_dimension(described)
    assert len(ax.lines) == len(alone.lines)
    for mine, other in zip(ax.lines, alone.lines, strict=True):
        np.testing.assert_array_equal(mine.get_xydata(), other.get_xydata())
        assert mine.get_markerfacecolor() == other.get_markerfacecolor()
    (band,), (other,) = (each.collections for each in (ax, alone))
    np.testing.assert_array_equal(band.get_paths()[0].vertices, other.get_paths()[0].vertices)


def test_boundary_without_a_dimension_is_not_called_free_of_contact():
    mask = xr.DataArray(np.eye(32, dtype=bool), dims=("y", "x"))
    result = fc.domains.boundary_dimension(mask)
    assert int(result.boundary_sides) > 0
    assert plotting.box_dimension(result)[0].texts[0].get_text() == "no dimension"
