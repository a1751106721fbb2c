"""Figures of the evolution of contact domains: every mark and colour is a number of the result."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_rgb
from plotting_figures import OPEN, colours, drawn, holds, render

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.schema import label

LOADS = [1e5, 1e6, 1e7]


def nested(loads=LOADS):
    """Return a path of contact states, each the one before with further cells."""
    heights = np.random.default_rng(3).random((12, 16))
    state = np.array([heights < share for share in (0.1, 0.3, 0.6)]).astype(np.int8)
    x, y = ((np.arange(n) + 0.5) * 1e-4 for n in (16, 12))
    coords = {"y": y, "x": x, "nominal_pressure": ("step", loads), "step": [0, 1, 2]}
    return label(xr.Dataset({"state": (("step", "y", "x"), state)}, coords))


def test_colour_is_the_load_of_first_contact():
    path = nested()
    ax = plotting.plot(path, "first_contact", units={"nominal_pressure": "MPa"})
    bar = ax.figure.axes[1]
    assert bar.get_ylabel() == "nominal pressure of first contact (MPa)"
    assert bar.get_ylim() == pytest.approx((0.1, 10.0))
    assert bar.get_yscale() == "log"  # a factor of 100 between the loads
    image, state = colours(ax), path.state.values
    assert np.array_equal(np.all(image == OPEN, axis=-1), state[-1] == 0)
    first = np.argmax(state > 0, axis=0)
    shown = [np.unique(image[(state[-1] > 0) & (first == step)], axis=0) for step in range(3)]
    assert [len(each) for each in shown] == [1, 1, 1]
    light = [float(each[0] @ (0.2126, 0.7152, 0.0722)) for each in shown]
    assert light == sorted(light)  # dark first: read in grey as well
    assert max(light) < 0.85 * float(np.array(to_rgb("#F2F0E9")) @ (0.2126, 0.7152, 0.0722))
    render(ax)


def test_first_contact_of_one_shear_and_without_a_load():
    path = nested()
    two = xr.concat([path, path.assign(state=path.state[::-1].assign_coords(step=path.step))], "shear")
    two = label(two.assign_coords(shear=[1e-4, 2e-4]))
    ax = plotting.plot(two, "first_contact", shear=2e-4)
    assert "0.2 mm" in ax.get_title(loc="left") or "200" in ax.get_title(loc="left")
    falling = colours(ax)[two.state.values[1, 0] > 0]
    assert len(np.unique(falling, axis=0)) == 1  # all of the largest set touches in the first step
    plain = plotting.plot(path.drop_vars("nominal_pressure"), "first_contact")
    assert plain.figure.axes[1].get_ylabel() == "step of first contact"
    render(plotting.plot(path.assign(state=path.state * 0), "first_contact"))
    with pytest.raises(InvalidInput, match="'state'"):
        plotting.plot(path.drop_vars("state"), "first_contact")


def test_lineage_and_the_coalescence_load():
    counts = {"n_islands": [4, 9, 8, 5], "births": [np.nan, 6, 3, 1], "absorbed": [np.nan, 1, 4, 4]}
    dims, loads = ("shear", "step"), [1.0, 2.0, 4.0, 8.0]
    data = {name: (dims, np.array([row, np.array(row) + 1], float)) for name, row in counts.items()}
    coords = {"shear": [1e-4, 2e-4], "step": np.arange(4), "normal_force": ("step", loads)}
    result = xr.Dataset(data, coords)
    result["shear"].attrs["units"], result["normal_force"].attrs["units"] = "m", "N"
    left, right = plotting.evolution(result)
    for ax, names in ((left, ["n_islands"]), (right, ["births", "absorbed"])):
        for name in names:
            for v in range(2):
                curves = [np.array(line.get_data(), float) for line in ax.lines]
                assert holds(curves, loads, result[name][v])
    marks = [line.get_xdata()[0] for line in right.lines if line.get_linestyle() == ":"]
    assert marks == [4.0, 4.0]  # the first load at which more islands are absorbed than born
    along_shear = plotting.evolution(result.isel(step=[1]), against="shear")
    assert along_shear[0].get_xlabel().startswith("shear displacement")
    growing = plotting.evolution(result.isel(step=[0, 1]))[1]
    assert not [line for line in growing.lines if line.get_linestyle() == ":"]
    render(left)
    with pytest.raises(InvalidInput, match="births"):
        plotting.evolution(result.drop_vars("births"))


def test_alluvial_bars_are_islands_and_ribbons_what_they_share():
    """Two islands grow together, a third one grows alone, a fourth is born."""
    rows = ("#...##..##........", "##..###.##........", "#######.###...####")
    cells = np.array([[[mark == "#" for mark in row]] for row in rows])
    loads = {"normal_force": ("step", [1.0, 2.0, 4.0]), "step": [0, 1, 2]}
    mask = label(xr.DataArray(cells.astype(np.int8), loads, ("step", "y", "x"), name="state"))
    ax = plotting.plot(fc.domains.lineage(mask), "alluvial")
    shapes = [path.vertices[:-1] for bars in ax.collections for path in bars.get_paths()]
    bars = [shape for shape in shapes if len(shape) == 4]
    heights = {place: [] for place in range(3)}
    for bar in bars:
        heights[round(bar[:, 0].mean())].append(np.ptp(bar[:, 1]))
    assert [sorted(heights[place]) for place in range(3)] == [[1, 2, 2], [2, 2, 3], [3, 4, 7]]
    ribbons = [shape for shape in shapes if len(shape) > 4]
    widths = [(round(shape[0, 0]), shape[-1, 1] - shape[0, 1]) for shape in ribbons]
    assert sorted(widths) == [(0, 1), (0, 2), (0, 2), (1, 2), (1, 2), (1, 3)]
    first, middle, last = ax.collections[:3]
    colours = [[tuple(colour) for colour in bars.get_facecolors()] for bars in (first, middle, last)]
    assert colours[0][0] == colours[0][1] == colours[1][0] == colours[1][1] == colours[2][0]  # they merge
    assert len({colours[0][2], *colours[2]}) == 3
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["1", "2", "4"]
    render(ax)
    many = np.broadcast_to(cells[2], (12, *cells[2].shape)).astype(np.int8)
    ax = plotting.plot(
        fc.domains.lineage(xr.DataArray(many, dims=("step", "y", "x"), name="state")), "alluvial"
    )
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["1", "3", "5", "7", "9", "11"]


def test_alluvial_of_one_shear_and_of_nothing(measured):
    rng = np.random.default_rng(1)
    cells = rng.random((2, 3, 16, 16)) < np.array([0.1, 0.2, 0.3])[:, None, None]
    coords = {"shear": [1e-4, 2e-4], "step": [0, 1, 2]}
    mask = label(xr.DataArray(cells, coords, ("shear", "step", "y", "x"), name="state").astype(np.int8))
    table = fc.domains.lineage(mask)
    for shear, states in zip((1e-4, 2e-4), cells, strict=True):
        ax = plotting.plot(table, "alluvial", shear=shear)
        tops = [max(path.vertices[:, 1].max() for path in bars.get_paths()) for bars in ax.collections[:3]]
        assert tops == states.sum((1, 2)).tolist()
        assert (ax.get_xlabel(), ax.get_title(loc="left")[:3]) == ("step", "$v$")
    empty = plotting.plot(fc.domains.lineage(mask * 0), "alluvial")
    assert "no islands" in [text.get_text() for text in empty.texts]
    render(empty)


@pytest.fixture(scope="module")
def measured():
    """The signature of two paths of random cells, and of discs."""
    rng = np.random.default_rng(5)
    shares = np.array([[0.02, 0.1, 0.2], [0.01, 0.05, 0.1]])
    masks = rng.random((2, 3, 64, 64)) < shares[..., None, None]
    x = (np.arange(64) + 0.5) * 1e-4
    coords = {
        "shear": [1e-4, 1e-3],
        "step": [0, 1, 2],
        "y": x,
        "x": x,
        "normal_force": ("step", [1.0, 2.0, 3.0]),
    }
    mask = xr.DataArray(masks, dims=("shear", "step", "y", "x"), coords=coords)
    return fc.domains.signature(label(mask.astype(np.int8).rename("state")))


def test_signature_draws_slopes_and_marks_spot_and_gap(measured):
    by_load, by_shear = plotting.signature(measured, shear=1e-4, normal_force=3.0)
    for ax, path in ((by_load, measured.isel(shear=0)), (by_shear, measured.isel(step=2))):
        dim = "step" if ax is by_load else "shear"
        curves = [np.array([line.get_xdata(), line.get_ydata()], float) for line in ax.lines]
        for i in range(path.sizes[dim]):
            state = path.isel({dim: i})
            assert holds(curves, state.side * 1e3, state.local_slope)
            for name in ("spot_size", "gap_size"):
                size = float(state[name])
                height = np.interp(np.log(size), np.log(state.side), state.local_slope)
                inside = float(state.side[0]) <= size <= float(state.side[-1])
                assert not inside or holds(curves, [size * 1e3], [height])
    numbers = plotting.curves(by_load)
    assert {"spot size, normal force F = 1 N", "gap size, normal force F = 1 N"} <= set(numbers["curve"])
    render(by_load)


def test_states_without_a_dimension_have_hollow_marks_and_the_window_is_shaded(measured):
    data = measured.isel(shear=0).assign(
        signature_flag=("step", np.array([5, 0, 0], np.int8)), window_low=5e-4, window_high=2e-3
    )
    (ax,) = plotting.signature(data)
    marks = [line for line in ax.lines if line.get_label().startswith("gap size") and len(line.get_xdata())]
    hollow = {line.get_label(): line.get_markerfacecolor() == ax.get_facecolor() for line in marks}
    assert hollow == {f"gap size, normal force $F$ = {load} N": load == 1 for load in (1, 2, 3)}
    (window,) = ax.patches
    left, right = np.sort(window.get_path().vertices[:, 0])[[0, -1]]
    corners = window.get_patch_transform().transform([[left, 0], [right, 0]])[:, 0]
    assert corners == pytest.approx([0.5, 2.0])
    named = [text.get_text() for legend in ax.artists for text in legend.get_texts()]
    assert {"spot size", "gap size", "no dimension", "window"} <= set(named)


def test_intervals_of_a_signature_are_drawn(measured):
    data = measured.isel(shear=0)
    (ax,) = plotting.signature(data)
    numbers = plotting.curves(ax).groupby("curve")["x"].apply(list)
    for step in range(3):
        state, inside = data.isel(step=step), f"normal force F = {step + 1} N"
        for name in ("spot_size", "gap_size"):
            curve = f"{name.replace('_', ' ')}, interval, {inside}"
            ends = [float(state[f"{name}_{end}"]) * 1e3 for end in ("low", "high")]
            if float(state.side[0]) <= float(state[name]) <= float(state.side[-1]):
                assert numbers[curve] == pytest.approx(ends)
    assert not [name for name in numbers.index if name.startswith("dimension")]  # of several, which overlap
    ends = {
        "window_low": 5e-4,
        "window_high": 2e-3,
        "domain_dimension_low": 0.9,
        "domain_dimension_high": 1.2,
    }
    (ax,) = plotting.signature(data.isel(step=1).assign(ends))
    band = plotting.curves(ax).query("curve == 'dimension, interval'")
    assert [band[axis].agg(f).item() for axis in "xy" for f in ("min", "max")] == [0.5, 2.0, 0.9, 1.2]
    for low, number in ((0.9, 1), (np.nan, 0)):  # the key of what is drawn, and of nothing else
        (ax,) = plotting.signature(data.isel(step=1).assign(ends | {"domain_dimension_low": low}))
        keys = [text.get_text() for legend in ax.artists for text in legend.get_texts()]
        assert keys.count("dimension, interval") == number


def test_windows_that_differ_between_states_are_not_shaded(measured):
    ends = {"window_low": ("step", [1e-4, 2e-4, 3e-4]), "window_high": ("step", [1e-3, 1e-3, 2e-3])}
    (ax,) = plotting.signature(measured.isel(shear=0).assign(ends))
    assert not ax.patches


def test_heat_maps_of_lacunarity_have_the_values_and_edges():
    sizes, loads = np.array([1, 2, 4, 8]), [1.0, 10.0, 100.0]
    values = 1 + np.arange(24.0).reshape(2, 3, 4)
    coords = {"shear": [1e-4, 2e-4], "step": np.arange(3), "normal_force": ("step", loads), "box_size": sizes}
    coords["box_length"] = ("box_size", 1e-4 * sizes)
    result = label(xr.Dataset({"lacunarity": (("shear", "step", "box_size"), values)}, coords))
    by_load, by_shear = plotting.lacunarity(result, shear=1e-4, maps=True)
    for ax, expected in ((by_load, values[0]), (by_shear, values[:, 2])):
        (mesh,) = ax.collections
        assert np.array_equal(np.asarray(mesh.get_array()).reshape(4, -1), expected.T)
    assert (by_load.get_xlabel(), by_load.get_xscale()) == ("normal force $F$ (N)", "log")
    corners = by_load.collections[0].get_coordinates()[0, :, 0]
    np.testing.assert_allclose(np.asarray(corners), [10**-0.5, 10**0.5, 10**1.5, 10**2.5])
    assert by_shear.get_xlabel().startswith("shear displacement")
    render(by_load)
    render(plotting.lacunarity(result.isel(shear=0, step=1), maps=True))
    unloaded = result.isel(shear=[0], step=[0, 1, 2, 1])
    (ax,) = plotting.lacunarity(unloaded, maps=True)
    assert ax.get_xlabel() == "state, in the order of the path"
    np.testing.assert_array_equal(ax.collections[0].get_coordinates()[0, :, 0], np.arange(-0.5, 4))
    ax.figure.draw_without_rendering()
    numbers = [tick for tick in ax.get_xticks() if -0.5 <= tick <= 3.5]
    assert numbers == [0, 1, 2, 3]  # there is no state 0.5


@pytest.mark.usefixtures("empty_files")
def test_a_study_draws_its_evolution(measured, tmp_path):
    path = nested()
    groups = {
        "/contact": path,
        "/domains/signature": measured,
        "/domains/evolution": fc.domains.evolution(path.state),
        "/domains/lacunarity": fc.domains.lacunarity(path.state),
    }
    names = {file.stem for file in plotting.draw(xr.DataTree.from_dict(groups), tmp_path)}
    assert {"first_contact", "signature", "evolution", "lacunarity", "lacunarity_maps"} <= names


def test_units_of_an_evolution(measured):
    ax = plotting.signature(measured.isel(shear=0), units={"side": "um"})[0]
    assert ax.xaxis.get_units() == "µm"
    side = plotting.path(measured.isel(shear=0), ["spot_size", "gap_size"], units={"spot_size": "um"})
    assert holds(drawn(side), measured.normal_force, measured.gap_size[0])
