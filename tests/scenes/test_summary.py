"""The summary: mean and deviation of the members, numbers that can be read, as wide as the screen."""

import re

import numpy as np
import pytest
import xarray as xr
from study import SOUND, command_here

import fractalcontact as fc
from fractalcontact.base.errors import ConvergenceWarning
from fractalcontact.base.file_contents import file_contents
from fractalcontact.base.units import quantity_text

ENSEMBLE = SOUND.replace("rng = 5", "rng = 5\nmembers = 4").replace(
    'joints = ["closure", "rigid_dilatancy"]',
    'dimensions = ["default"]\njoints = ["closure", "elastic_dilatancy", "friction"]\n'
    'domains = ["box_dimension"]\n',
)


@pytest.fixture(scope="module")
def ensemble(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ensemble")
    (folder / "study.toml").write_text(ENSEMBLE, encoding="utf-8")
    return fc.scenes.run(folder / "study.toml", progress=False)


@pytest.fixture(autouse=True)
def _wide_screen(monkeypatch):
    monkeypatch.setenv("COLUMNS", "250")


def rows(tree, title):
    """Return the rows of one table of the whole summary, each a dict by the head of the column."""
    lines = fc.scenes.summary(tree, verbose=True).split(f"\n\n{title}\n")[1].split("\n\n")[0].splitlines()
    starts = [match.start() for match in re.finditer("-+", lines[1])]
    ends = [*starts[1:], None]
    body = [line for line in lines if line[:1].strip()]
    cut = [[line[a:b].strip() for a, b in zip(starts, ends, strict=True)] for line in body]
    return [dict(zip(cut[0], cells, strict=True)) for cells in cut[2:] if cells[0]]


def remarks(tree):
    """Return the words of the whole summary."""
    return " ".join(fc.scenes.summary(tree, verbose=True).split())


def test_summary_shows_mean_and_deviation_of_the_members(ensemble):
    text = fc.scenes.summary(ensemble)
    assert "ensemble of 4 members: mean ± standard deviation" in text
    percent = ensemble["joints/closure"].contact_fraction.isel(step=-1).values * 100
    for column, cells in enumerate(rows(ensemble, "closure")):
        mean, spread = (float(word) for word in cells["contact area"].removesuffix(" %").split(" ± "))
        assert mean == pytest.approx(percent[:, column].mean(), rel=0.05)
        assert spread == pytest.approx(percent[:, column].std(ddof=1), rel=0.05)
    dimension = ensemble["dimensions"].fractal_dimension.values[:, 0]
    cell = rows(ensemble, "fractal dimension")[0]["dimension D"]
    assert cell == f"{dimension.mean():.3f} ± {dimension.std(ddof=1):.3f}"


def test_loads_of_all_members_have_no_deviation(ensemble):
    assert rows(ensemble, "closure")[0]["normal force"] == "10 N"


def test_peak_strength_states_its_distance_and_its_form(ensemble):
    """The energy form by hand: secants of delta + U/N over the distance, for every member and force."""
    words = remarks(ensemble)
    friction = ensemble["joints/friction"].to_dataset()
    elastic = ensemble["joints/elastic_dilatancy"].to_dataset()
    distance, shear = float(friction.peak_distance.max()), elastic.shear.values
    energy = elastic.dilatancy + elastic.elastic_energy / elastic.normal_force
    differences = []
    for member in range(elastic.sizes["member"]):
        for step in range(elastic.sizes["step"]):
            peaks = []
            for curve in (elastic.dilatancy, energy):
                values = curve.isel(member=member, step=step).transpose("shear", ...).values.ravel()
                starts = shear[shear <= shear[-1] - distance * (1 - 1e-9)]
                rises = np.interp(starts + distance, shear, values) - np.interp(starts, shear, values)
                peaks.append(np.degrees(np.arctan(rises.max() / distance)))
            differences.append(peaks[1] - peaks[0])
    expected = f'form = "energy" gives {min(differences):+.1f} to {max(differences):+.1f} degree'
    assert expected in words
    assert "+" in expected


def test_strength_near_locking_changes_far_more_than_its_angle():
    """Two straight parts: 88.5 degree over the first 100 µm and 87 over 200 µm, half a step from locking."""
    shear = np.arange(9) * 1e-4
    rise = 35.0
    slopes = np.tan(np.radians(np.array([88.5, 85.0, *([40.0] * 6)]) - rise))
    climb = xr.DataArray(np.concatenate([[0.0], np.cumsum(slopes) * 1e-4]), dims="shear")
    surface = fc.surfaces.from_array(np.zeros((16, 32)), 1e-4)
    crack = fc.joints.Crack(surface, young=30e9, poisson=0.2, block=(8e-4, 8e-4), basic_friction_angle=rise)
    rigid = fc.joints.dilatancy(crack, shear=shear, direction="E")
    rigid["rigid_dilatancy"] = rigid["rigid_dilatancy"].copy(data=climb.values[None])
    friction = fc.joints.friction(rigid, distance=2e-4, nominal_pressure=1e6)
    words = remarks(xr.DataTree.from_dict({"joints/friction": friction}))
    over_two = rise + np.degrees(np.arctan(slopes[:2].mean()))
    change = np.tan(np.radians(88.5)) / np.tan(np.radians(over_two)) - 1
    assert f"The strength changes by up to {100 * change:.0f} %." in words
    assert "energy" not in words  # rigid faces store none


def test_nothing_is_said_of_the_peak_of_faces_that_lock():
    """A wall of slope 10, 84 degree, beside a basic angle of 30: no distance has a friction angle."""
    surface = fc.surfaces.from_array(10.0 * 1e-4 * np.arange(32.0) * np.ones((16, 1)), 1e-4)
    crack = fc.joints.Crack(surface, young=30e9, poisson=0.2, block=(8e-4, 8e-4), basic_friction_angle=30)
    rigid = fc.joints.dilatancy(crack, shear=np.arange(9) * 1e-4, direction="E")
    friction = fc.joints.friction(rigid, distance=2e-4, nominal_pressure=1e6)
    assert "degree" not in friction["peak_friction_angle"].attrs["comment"]
    tree = xr.DataTree.from_dict({"joints/friction": friction})
    text = fc.scenes.summary(tree)
    assert "none: the faces lock" in text
    assert "distance" not in remarks(tree)
    assert "°" not in text


def test_standard_errors_of_the_members_are_a_span(ensemble):
    errors = ensemble["dimensions"].standard_error.values[:, 0]
    ends = dict.fromkeys(f"{end:.4f}" for end in (errors.min(), errors.max()))
    line = next(
        line for line in fc.scenes.summary(ensemble, verbose=True).splitlines() if "error of H" in line
    )
    method = ensemble["dimensions"]["method"].values[0]
    assert line.split("standard error of H ")[1].strip() == f"{method} {' to '.join(ends)}"


def test_standard_errors_name_their_method(tmp_path):
    scene = tmp_path / "study.toml"
    start = SOUND.partition("[material]")[0]
    scene.write_text(f"{start}[want]\ndimensions = ['variogram', 'spectrum']\n", encoding="utf-8")
    tree = fc.scenes.run(scene, progress=False)
    errors = tree["dimensions"].standard_error
    expected = [f"{name} {errors.sel({'method': name}).item():.4f}" for name in errors["method"].values
                if np.isfinite(errors.sel({"method": name}))]  # fmt: skip
    assert expected
    assert f"standard error of H {', '.join(expected)}" in fc.scenes.summary(tree, verbose=True)


def test_single_study_names_no_members(ensemble):
    single = ensemble.map_over_datasets(lambda dataset: dataset.isel(member=1, missing_dims="ignore"))
    text = fc.scenes.summary(single)
    assert "members" not in text
    assert "±" not in text
    fraction = float(single["joints/closure"].contact_fraction[0, -1])
    assert rows(single, "closure")[0]["contact area"] == f"{fraction * 100:.3g} %"


def test_members_without_a_value_are_counted(ensemble):
    holed = ensemble.copy()
    closing = holed["joints/closure"].to_dataset()
    closing["closure"] = closing["closure"].where(closing["member"] != 2)
    closing["interface_closure"] = closing["interface_closure"].where(False)
    holed["joints/closure"] = xr.DataTree(closing)
    cells = rows(holed, "closure")[0]
    assert cells["closure"].endswith("µm (3 of 4)")
    assert cells["interface closure"] == "-"


def test_members_without_an_interval_are_counted(ensemble):
    holed = ensemble.copy()
    boxes = holed["domains/box_dimension"].to_dataset().isel(step=-1, shear=-1)
    boxes["ci_low"] = ("member", [0.5, np.nan, 0.7, 0.8])
    boxes["ci_high"] = ("member", [1.5, 1.6, 1.7, np.inf])
    holed["domains/box_dimension"] = xr.DataTree(boxes)
    assert rows(holed, "box")[0]["95 % interval"] == "0.60 to 1.60 (2 of 4)"  # of both that have both ends


def test_members_whose_contacts_cross_are_counted(ensemble):
    tree = ensemble.copy()
    crosses = [[True, True], [True, False], [True, False], [True, True]]
    percolation = xr.Dataset({"percolates": (("member", "axis"), crosses)}, {"axis": ["x", "y"]})
    for axes, words in ((["x", "y"], "along x and y (2 of 4)"), (["y"], "along y (2 of 4)")):
        tree["domains/percolation"] = xr.DataTree(percolation.sel(axis=axes))
        assert f"contacts cross {words}" in remarks(tree)


def test_directional_roughness_of_members_has_its_deviation():
    faces = fc.surfaces.fbm((32, 32), 2e-4, hurst=0.7, rms_increment=3e-5, rng=3, members=3)
    of_each = [fc.joints.directional_roughness(faces.isel(member=number)) for number in range(3)]
    rose = xr.concat(of_each, xr.Variable("member", range(3)), combine_attrs="override")
    metric = rose.roughness_metric
    greatest = metric.isel(azimuth=int(metric.mean("member").argmax("azimuth")))
    expected = f"{float(greatest.mean()):.2f} ± {float(greatest.std(ddof=1)):.2f}°"
    text = remarks(xr.DataTree.from_dict({"/joints/directional_roughness": rose}))
    assert f"largest roughness metric {expected} toward {float(greatest.azimuth):g}°" in text


def test_members_are_counted_whose_dimension_has_a_note_or_no_interval(ensemble):
    tree = ensemble.copy()
    estimates = tree["dimensions"].to_dataset().isel(method=[0]).assign_coords(method=["default"])
    estimates["reason"] = (("member", "method"), [["too few"], [""], ["too few"], ["seams"]])
    estimates["note"] = (("member", "method"), [["smooth"]] * 4)
    tree["dimensions"] = xr.DataTree(estimates)
    text = remarks(tree)
    for words in ("default (2 of 4): too few", "default (1 of 4): seams", "default: smooth"):
        assert words in text
    assert "D has no interval (2 of 4): too few. D has no interval (1 of 4): seams." in text


@pytest.mark.parametrize(("increment", "below"), [(5.75e-5, [False, True, False]), (1e-5, [True] * 3)])
def test_jrc_of_members_below_the_scale_is_not_in_the_mean(increment, below, tmp_path):
    (tmp_path / "study.toml").write_text(
        '[surface]\ngenerate = "fbm"\nshape = [32, 32]\nspacing = 5e-4\nhurst = 0.8\nrng = 2\nmembers = 3\n'
        f'rms_increment = {increment}\n[joint.roughness_coefficient]\ndirection = "E"\n'
        '[want]\njoints = ["roughness_coefficient"]\n',
        encoding="utf-8",
    )
    tree = fc.scenes.run(tmp_path / "study.toml", progress=False)
    jrc = tree["joints/roughness_coefficient/roughness_coefficient"].values.ravel()
    assert (jrc < 0).tolist() == below
    counted = jrc[jrc >= 0]
    mean = tree["roughness_coefficient"]
    assert "mean over the members" in mean.attrs["long_name"]
    (row,) = rows(tree, "joint roughness coefficient (JRC)")
    if counted.size:
        assert row["JRC"] == f"{counted.mean():.1f} ± {counted.std(ddof=1):.1f} (2 of 3)"
        assert float(mean) == pytest.approx(counted.mean())
    else:
        assert row["JRC"] == "below 0"
        assert np.isnan(mean)


@pytest.mark.parametrize("columns", [80, 160])
def test_summary_plan_and_contents_fit_the_screen(ensemble, columns, monkeypatch, tmp_path):
    monkeypatch.setenv("COLUMNS", str(columns))
    path = fc.save(ensemble, tmp_path / "result.nc")
    plan = str(fc.scenes.plan(fc.scenes.load("concrete_crack")))
    whole = fc.scenes.summary(ensemble, verbose=True)
    for text in (fc.scenes.summary(ensemble), whole, file_contents(path), plan):
        assert max(map(len, text.splitlines())) <= columns


def test_command_fits_the_screen(monkeypatch):
    monkeypatch.setenv("COLUMNS", "72")
    for words in (("run", "--plan", "concrete_crack"), ("methods",)):
        lines = command_here(*words).stdout.splitlines()
        assert 50 < max(map(len, lines)) <= 72


def test_last_line_of_a_run_fits_the_screen(monkeypatch, tmp_path):
    monkeypatch.setenv("COLUMNS", "60")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(SOUND, encoding="utf-8")
    done = command_here("run", "study.toml", "-o", "out")
    assert done.returncode == 0, done.stderr
    last = done.stdout[done.stdout.index("written to") :].splitlines()
    assert max(map(len, last)) <= 60
    assert "report.html" in " ".join(last)


def test_window_of_the_dimension_is_named_in_lengths(ensemble):
    boxes = ensemble["domains/box_dimension"].to_dataset().isel(step=-1)
    cells = rows(ensemble, "box")
    for each, row in ((boxes.isel(shear=0), cells[0]), (boxes.isel(shear=-1), cells[-1])):
        low, high = float(each.window_low.min()), float(each.window_high.max())
        assert row["over"] == f"{quantity_text(low, 'm')} to {quantity_text(high, 'm')}"


def test_units_follow_the_values():
    surface = fc.surfaces.spectral((32, 32), 1e-7, hurst=0.8, rms_slope=0.1, rng=1)
    pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e6, 1e7])
    tree = xr.DataTree.from_dict({"contact": pressed})
    assert [cells["nominal pressure"] for cells in rows(tree, "contact")] == ["1 MPa", "10 MPa"]
    assert rows(tree, "contact")[0]["closure"].endswith(" nm")
    assert "e+0" not in fc.scenes.summary(tree)


def test_deviations_have_two_digits_also_before_the_point():
    face = fc.surfaces.fbm((32, 32), 5e-4, hurst=0.8, rms_increment=8e-5, rng=2)
    islands = fc.domains.islands(face > 0).expand_dims(member=3).copy(deep=True)
    islands["mean_island_area"].values[:] = [16e-9, 18.6e-9, 20.8e-9]
    islands["largest_island"].values[:] = [220e-12, 359e-12, 480e-12]
    cells = rows(xr.DataTree.from_dict({"/domains/islands": islands}), "islands")
    values = {row["quantity"]: row["value"] for row in cells}
    assert values["mean area"] == "18500 ± 2400 µm²"
    assert values["largest island"] == "350 ± 130 µm²"


def test_pressure_of_a_spring_says_at_which_shear_it_is():
    face = fc.surfaces.fbm((48, 48), 2e-4, hurst=0.7, rms_increment=3e-5, rng=3)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=4.8e-3, basic_friction_angle=32)
    options = {"shear": [0.0, 2e-4, 4e-4], "normal_force": [20.0, 60.0]}
    for stiffness, head in ((5e9, "nominal pressure, at the last shear"), (None, "nominal pressure")):
        climb = fc.joints.dilatancy(crack, normal_stiffness=stiffness, **options)
        groups = {"/joints/elastic_dilatancy": climb, "/joints/friction": fc.joints.friction(climb)}
        tree = xr.DataTree.from_dict(groups)
        for title in ("elastic dilatancy", "peak shear strength"):
            assert head in rows(tree, title)[0]


def test_column_has_one_unit_within_three_decades():
    surface = fc.surfaces.spectral((32, 32), 1e-7, hurst=0.8, rms_slope=0.1, rng=1)
    for pressures, shown in (([4e5, 6e5], ["0.4 MPa", "0.6 MPa"]), ([1e3, 1e7], ["1 kPa", "10 MPa"])):
        pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=pressures)
        tree = xr.DataTree.from_dict({"contact": pressed})
        assert [cells["nominal pressure"] for cells in rows(tree, "contact")] == shown


def test_states_whose_force_is_not_determined_are_named_by_their_closure():
    surface = fc.surfaces.spectral((32, 32), 1e-7, hurst=0.8, rms_slope=0.1, rng=1)
    most = float(surface.max() - surface.mean())
    with pytest.warns(ConvergenceWarning):
        pressed = fc.contact.press(surface, contact_modulus=1e9, closure=[0.5 * most, 1.5 * most, 2 * most])
    tree = xr.DataTree.from_dict(
        {"contact": pressed, "domains/islands": fc.domains.islands(pressed["state"])}
    )
    for title in ("contact", "islands"):
        first, *beyond = (cells["nominal pressure"] for cells in rows(tree, title))
        assert first.endswith("Pa")
        assert beyond == [f"closure {1e9 * factor * most:.3g} nm" for factor in (1.5, 2)]


def test_transmissivity_of_parallel_plates_in_two_units():
    """Plates 0.1 mm apart: w^3/12 = 8.33e-14 m3, times 998.2 kg/m3 9.81 m/s2 / 1.002 mPa s = 8.14e-7 m2/s."""
    gap = fc.surfaces.from_array(np.full((8, 8), 1e-4), 1e-3).expand_dims(step=[0])
    flow = fc.joints.transmissivity(gap.assign_coords(normal_force=("step", [5.0], {"units": "N"})))
    text = remarks(xr.DataTree.from_dict({"joints/transmissivity": flow}))
    assert "cubed over 12: 8.33e-14 m³; times unit weight over viscosity" in text
    assert "for water at 20 °C, 8.14e-07 m²/s" in text


def test_transmissivities_of_several_shears_reach_down_to_a_closed_one():
    gap = fc.surfaces.from_array(np.full((8, 8), 1e-4), 1e-3).expand_dims(shear=[0.0, 1e-3], step=[0])
    opening = xr.DataArray([0.0, 1.0], dims="shear")  # the first of the two is closed
    flow = fc.joints.transmissivity(gap * opening)
    text = remarks(xr.DataTree.from_dict({"joints/transmissivity": flow}))
    assert "cubed over 12: 0 to 8.33e-14 m³" in text
    assert "for water at 20 °C, 0 to 8.14e-07 m²/s" in text


def test_small_forces_are_not_zero_kilonewton():
    face = fc.surfaces.fbm((32, 32), 1e-7, hurst=0.8, rms_increment=3e-9, rng=1)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=16e-7)
    closing = fc.joints.closure(crack, shear=[2e-7], normal_force=[2e-6])
    tree = xr.DataTree.from_dict({"joints/closure": closing})
    cells = rows(tree, "closure")[0]
    assert next(iter(cells.values())) == "200 nm"
    assert cells["normal force"] == "2 µN"
    text = remarks(tree)
    assert f"the last step of the load, {2e-6 / 16e-7**2 / 1e6:.3g} MPa on the area of the block" in text


def test_no_negative_zero_and_no_contradiction_beside_the_dimension():
    mask = np.zeros((2, 64, 64), bool)
    mask[:, ::16, ::16] = True
    mask[1, 20:24, 20:24] = True
    state = xr.DataArray(mask, dims=("shear", "y", "x"), coords={"shear": [1e-4, 2e-4]})
    for dim in ("y", "x"):
        state = state.assign_coords({dim: (dim, np.arange(64) * 1e-5, {"units": "m"})})
    boxes = fc.domains.box_dimension(state)
    words = remarks(xr.DataTree.from_dict({"domains/box_dimension": boxes}))
    assert "-0.00" not in words
    number = int(boxes.differs_from_random.sum())
    assert f"{number} of 2 sets differ" in words
    assert "yes" not in words


def test_summary_has_roughness_and_parameters_of_iso_25178():
    """The numbers are those of the functions, for the same surface."""
    surface = fc.surfaces.fbm((64, 64), 2e-4, hurst=0.7, rms_increment=3e-5, rng=3)
    jrc, rose = fc.joints.roughness_coefficient(surface), fc.joints.directional_roughness(surface)
    statistics = fc.surfaces.describe(surface)
    tree = xr.DataTree.from_dict(
        {
            "/surfaces": statistics,
            "/joints/roughness_coefficient": jrc,
            "/joints/directional_roughness": rose,
        }
    )
    values = {cells["quantity"]: cells["value"] for cells in rows(tree, "ISO 25178")}
    assert values["Sq"] == f"{float(statistics.rms_height) * 1e6:.3g} µm"
    assert values["Sdq"] == f"{float(statistics.rms_slope):.3f}"
    (east, _) = rows(tree, "joint roughness coefficient (JRC)")
    assert east["JRC"] == f"{float(jrc.roughness_coefficient[0]):.1f}"
    assert "Azimuths are from E (+x) anticlockwise" in remarks(tree)
    metric = rose.roughness_metric
    azimuth = float(metric.azimuth[int(metric.argmax("azimuth"))])
    largest = f"largest roughness metric {float(metric.max()):.2f}° toward {azimuth:g}°"
    assert largest in fc.scenes.summary(tree)
    assert "smallest roughness metric" in fc.scenes.summary(tree)
    single = xr.DataTree.from_dict({"/joints/directional_roughness": rose.isel(azimuth=[0])})
    assert "smallest roughness metric" not in fc.scenes.summary(single)


def test_slopes_of_a_polished_surface_are_not_shown_as_zero():
    surface = fc.surfaces.spectral((64, 64), 1e-6, hurst=0.8, rms_slope=4e-4, rng=1)
    statistics = fc.surfaces.describe(surface)
    cells = rows(xr.DataTree.from_dict({"/surfaces": statistics}), "ISO 25178")
    values = {each["quantity"]: each["value"] for each in cells}
    assert float(values["Sdq"]) == pytest.approx(4e-4)
    assert float(values["Sdr"]) == pytest.approx(float(statistics.developed_area_excess), rel=5e-3)


@pytest.mark.parametrize("periodic", [False, True])
def test_mean_plane_is_shown_beside_the_rms_height(periodic):
    """Sq of a tilted face is that of its plane, for the most part; an axis that repeats has no tilt."""
    heights = np.tile(1e-5 * np.sin(2 * np.pi * (np.arange(64) + 0.5) / 64), (48, 1))
    if not periodic:
        heights += 0.1 * 1e-4 * np.arange(48)[:, None]
    face = fc.surfaces.from_array(heights, 1e-4, periodic=periodic)
    tree = xr.DataTree.from_dict({"/surfaces": fc.surfaces.describe(face).assign(height=face)})
    values = {cells["quantity"]: cells["value"] for cells in rows(tree, "ISO 25178")}
    plane = np.sqrt(float(face.var()) - float(fc.surfaces.level(face).var()))
    assert values.get("of it the mean plane") == (None if periodic else f"{1e6 * plane:.3g} µm")


@pytest.mark.parametrize(("increment", "outside"), [(1e-8, True), (3e-5, False)])
def test_coefficient_beyond_the_standard_profiles_is_told(increment, outside):
    surface = fc.surfaces.fbm((64, 64), 2e-4, hurst=0.7, rms_increment=increment, rng=3)
    jrc = fc.joints.roughness_coefficient(surface)
    text = remarks(xr.DataTree.from_dict({"/joints/roughness_coefficient": jrc}))
    assert bool((jrc.scale_position != 0).any()) is outside
    assert ("is extrapolated" in text) is outside
    screen = " ".join(
        fc.scenes.summary(xr.DataTree.from_dict({"/joints/roughness_coefficient": jrc})).split()
    )
    assert ("JRC outside 0 to 20, the scale of the standard profiles, is extrapolated" in screen) is outside


def test_many_rows_are_thinned_to_fit_the_screen(monkeypatch):
    """Tables lose rows; the first and the last one stay, and the head says how many are shown."""
    monkeypatch.setenv("COLUMNS", "80")
    shears = [1e-4 * k for k in range(1, 31)]
    face = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=4e-6, rng=5)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=2.4e-3, basic_friction_angle=30)
    rigid = fc.joints.dilatancy(crack, shear=shears[:8], direction=[10.0 * k for k in range(30)])
    estimates = fc.dimensions.estimate(face, list(fc.dimensions.methods()))
    tree = xr.DataTree.from_dict({"/joints/rigid_dilatancy": rigid, "/dimensions": estimates})
    text = fc.scenes.summary(tree)
    assert len(text.splitlines()) <= 36
    assert "of 30)" in text
    assert {"E", "290°"} <= {line.split()[0] for line in text.splitlines() if line}
    whole = fc.scenes.summary(tree, verbose=True)
    numbers = {f"{10 * k}°" for k in range(30) if k % 9}  # the others are compass directions
    assert numbers <= {line.split()[0] for line in whole.splitlines() if line}


def test_tables_over_the_same_rows_are_one_on_the_screen(ensemble):
    lines = fc.scenes.summary(ensemble).splitlines()
    (head,) = [line for line in lines if "contact area" in line]
    assert "box D (random)" in head


def test_caveats_on_the_screen_are_three_at_most(tmp_path):
    """Of a soft steep face: islands, pressures and slopes, each of the surface and of the joint."""
    text = SOUND.replace("rms_increment = 4e-6", "rms_increment = 5e-5").replace("hurst = 0.8", "hurst = 0.3")
    text = text.replace("poisson = 0.2", "poisson = 0.2\nyield_pressure = 1e6")
    text = text.replace("[want]", "[contact]\nnormal_force = [1.0, 10.0]\n[want]\ncontact = ['press']")
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    tree = fc.scenes.run(tmp_path / "study.toml", out=tmp_path / "out", progress=False)
    limits = tree.attrs["caveats"].splitlines()
    assert len(limits) == 6
    shown, whole = (" ".join(fc.scenes.summary(tree, verbose=each).split()) for each in (False, True))
    assert [limit in shown for limit in limits] == [True] * 3 + [False] * 3
    assert "caveats left out: 3" in shown
    assert all(limit in whole for limit in limits)


def test_analysis_of_the_contact_set_is_on_the_screen(tmp_path):
    """Islands, percolation, lacunarity and signature that a scene asks for, as the functions give them."""
    text = SOUND.replace('"closure", "rigid_dilatancy"]', '"closure"]\nkeep = ["state"]')
    words = '["islands", "percolation", "lacunarity", "signature"]'
    (tmp_path / "study.toml").write_text(f"{text}domains = {words}\nfigures = true\n", encoding="utf-8")
    tree = fc.scenes.run(tmp_path / "study.toml", out=tmp_path / "out", progress=False)
    assert (tmp_path / "out" / "domains_percolation.png").is_file()  # its entry in the table of stages has it
    shown = fc.scenes.summary(tree)
    assert len(shown.splitlines()) <= 36
    for head in ("islands", "contacts cross", "lacunarity (random)", "spot", "gap"):
        assert head in shown
    state = tree["joints/closure/state"]
    alone = fc.domains.signature(state)
    stored = tree["domains/signature"].to_dataset()
    np.testing.assert_array_equal(stored["spot_size"], alone["spot_size"])
    count = int(fc.domains.islands(state)["n_islands"][-1, -1])
    assert rows(tree, "islands")[-1]["islands"] == str(count)


def test_states_whose_boxes_are_saturated_are_counted():
    mask = np.zeros((2, 64, 64), bool)
    mask[0, ::16, ::16] = True
    mask[1] = np.random.default_rng(1).random((64, 64)) < 0.3
    boxes = fc.domains.box_dimension(xr.DataArray(mask, dims=("step", "y", "x")))
    assert "half of the largest boxes meet the contacts in 1 of 2 states" in remarks(
        xr.DataTree.from_dict({"domains/box_dimension": boxes})
    )
    assert "largest boxes" not in remarks(
        xr.DataTree.from_dict({"domains/box_dimension": boxes.isel(step=[0])})
    )


@pytest.mark.parametrize("along", ["step", "shear"])
@pytest.mark.parametrize("in_metres", [False, True])
def test_sets_without_loads_have_rows_and_windows_in_their_own_unit(along, in_metres):
    """Masks of a user have neither loads nor shears, and some no lengths."""
    places = (np.arange(64) + 0.5) * 1e-4
    coords = {"y": places, "x": places} if in_metres else {}
    cells = np.random.default_rng(1).random((2, 64, 64)) < 0.3
    mask = xr.DataArray(cells, coords, (along, "y", "x"))
    names = "box_dimension", "percolation", "describe", "islands", "evolution", "signature"
    groups = {f"/domains/{name}": getattr(fc.domains, name)(mask) for name in names}
    text = fc.scenes.summary(xr.DataTree.from_dict(groups)).replace("\N{NO-BREAK SPACE}", " ")
    assert ("100 µm to 0.8 mm" in text) == in_metres
    assert ("1 to 8 cells" in text) == (not in_metres)


def test_slope_of_a_level_face_is_left_out():
    """A mean slope that rounds to zero is no result."""
    dilatancy = fc.joints.dilatancy(
        fc.joints.Crack(fc.surfaces.spectral((32, 32), 1e-4, hurst=0.8, rms_slope=0.1, rng=1)),
        shear=[0, 1e-4],
    )
    tree = xr.DataTree.from_dict({"/joints/rigid_dilatancy": dilatancy})
    assert "rigid dilatancy" in fc.scenes.summary(tree)
    assert "slope of face" not in fc.scenes.summary(tree)
    tilted = tree.copy()
    tilted["joints/rigid_dilatancy"] = dilatancy.assign(mean_slope=dilatancy.mean_slope + 0.01)
    assert "+0.0100" in fc.scenes.summary(tilted)


def test_hydraulic_apertures_have_one_unit():
    """Parallel plates carry water as their distance: 234, 238 and 555 µm are one column."""
    widths = np.array([234e-6, 238e-6, 555e-6])
    gap = xr.concat([fc.surfaces.from_array(np.full((8, 8), width), 1e-3) for width in widths], "shear")
    gap = gap.assign_coords(shear=("shear", [0.0, 6e-4, 3e-3], {"units": "m"}))
    tree = xr.DataTree.from_dict({"joints/transmissivity": fc.joints.transmissivity(gap)})
    cells = [row["hydraulic (x)"] for row in rows(tree, "aperture")]
    assert cells == ["234 µm", "238 µm", "555 µm"]


def test_zero_lengths_have_a_unit_of_their_size():
    """The steepest climb begins at once."""
    surface = fc.surfaces.from_array(np.zeros((16, 32)), 1e-4)
    crack = fc.joints.Crack(surface, young=30e9, poisson=0.2, block=(8e-4, 8e-4), basic_friction_angle=30)
    rigid = fc.joints.dilatancy(crack, shear=np.arange(9) * 1e-4, direction="E")
    rigid["rigid_dilatancy"] = rigid["rigid_dilatancy"].copy(data=[np.sqrt(np.arange(9)) * 1e-5])
    friction = fc.joints.friction(rigid, distance=2e-4, nominal_pressure=1e6)
    tree = xr.DataTree.from_dict({"joints/friction": friction})
    (row,) = rows(tree, "peak shear strength")
    assert (row["from shear"], row["slope over"]) == ("0 mm", "200 µm")


def test_reason_of_states_without_a_dimension_belongs_to_one_of_them():
    masks = np.zeros((2, 64, 64), bool)
    masks[0, 5, 5], masks[1, ::16, ::16] = True, True
    coords = {"y": np.arange(64) * 1e-4, "x": np.arange(64) * 1e-4}
    signature = fc.domains.signature(xr.DataArray(masks, coords, ("step", "y", "x")))
    words = remarks(xr.DataTree.from_dict({"domains/signature": signature}))
    assert f"2 of 2 states have no dimension; the last of them: {signature.reason.values[1]}." in words
    words = remarks(xr.DataTree.from_dict({"domains/signature": signature.isel(step=[0, 0])}))
    assert f"2 of 2 states have no dimension: {signature.reason.values[0]}." in words


def test_window_of_the_signature_is_said_once_and_where_its_columns_are():
    mask = xr.DataArray(np.random.default_rng(1).random((2, 64, 64)) < 0.02, dims=("step", "y", "x"))
    mask = mask.assign_coords({dim: np.arange(64) * 1e-4 for dim in "yx"})
    groups = {f"domains/{name}": getattr(fc.domains, name)(mask) for name in ("signature", "evolution")}
    both, alone = (
        remarks(xr.DataTree.from_dict({name: groups[name] for name in names}))
        for names in (groups, ["domains/evolution"])
    )
    assert both.count("D is over") == both.count("; clustering and patches at") == 1
    assert alone.count("D is over") == 1
    for words in (both, alone):  # since which state the islands are counted
        assert words.count("splits are those since the state before") == 1
    assert "patches" not in alone


def test_boundary_has_three_digits_and_names_no_random_null():
    surface = fc.surfaces.spectral((96, 96), 1e-6, hurst=0.8, rolloff=4e-5, rms_slope=0.15, rng=3)
    mask = surface > 2e-7
    words = remarks(
        xr.DataTree.from_dict({"domains/boundary_dimension": fc.domains.boundary_dimension(mask)})
    )
    assert "(random)" not in words
    assert "1 to 2.83 cells" in words


def test_numbers_of_caveats_have_no_exponents():
    surface = fc.surfaces.spectral((32, 32), 1e-7, hurst=0.8, rms_slope=0.1, rng=1)
    pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e6, 1e7])
    steep = pressed.assign(rms_slope=pressed["rms_slope"].copy(data=560.0))
    assert "rms slope of up to 560;" in remarks(xr.DataTree.from_dict({"contact": steep}))


@pytest.fixture(scope="module")
def strong_joint():
    """A joint with the tables of the command `joint --friction-angle --jcs`."""
    face = fc.surfaces.fbm((48, 48), 2e-4, hurst=0.7, rms_increment=6e-5, rng=3)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=4.8e-3, basic_friction_angle=32)
    pressures = [1e6, 3e6, 10e6]
    strength = {"wall_strength": 120e6, "basic_friction_angle": 32.0}
    shear = [0.0, 2e-4, 8e-4, 1.6e-3]
    names = {
        "directional_roughness": fc.joints.directional_roughness(face),
        "roughness_coefficient": fc.joints.roughness_coefficient(face, lag=6e-4),
        "rigid_dilatancy": fc.joints.dilatancy(crack, shear=shear, direction=["E", "N", "W", "S"]),
        "closure": fc.joints.closure(crack, shear=shear, nominal_pressure=pressures, direction="E"),
        "strength_envelope": fc.joints.strength_envelope(face, nominal_pressure=pressures, **strength),
        "shear_curve": fc.joints.shear_curve(
            face,
            displacement=shear,
            nominal_pressure=pressures,
            wall_strength=120e6,
            residual_friction_angle=32,
        ),
    }
    return xr.DataTree.from_dict({f"joints/{name}": result for name, result in names.items()})


@pytest.mark.parametrize("columns", [44, 56, 80, 110])
def test_strength_is_on_the_screen_where_not_all_tables_are(strong_joint, columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    text = fc.scenes.summary(strong_joint)
    assert len(text.splitlines()) <= 36
    for name in ("barton_choubey", "xia"):
        assert name in text
    assert "1 of " not in text
    assert "2 of " not in text


def test_columns_of_wide_cells_are_left_out_before_tables(strong_joint, monkeypatch):
    """In a narrow window the scatter of JRC takes two lines a row; without it one more table fits."""
    face = fc.surfaces.fbm((48, 48), 2e-4, hurst=0.7, rms_increment=6e-5, rng=3)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=4.8e-3, basic_friction_angle=32)
    shear, pressures = [0.0, 2e-4, 8e-4, 1.6e-3], [1e6, 3e6, 10e6]
    gap = fc.joints.closure(crack, shear=shear, nominal_pressure=1e7, keep="gap")["gap"].isel(step=-1)
    sheared = fc.joints.direct_shear(crack, path=1.6e-3, nominal_pressure=pressures, hardness=120e6)
    groups = {f"joints/{name}": node.to_dataset() for name, node in strong_joint["joints"].children.items()}
    flow = fc.joints.transmissivity(gap)
    tree = xr.DataTree.from_dict(groups | {"joints/direct_shear": sheared, "joints/transmissivity": flow})
    monkeypatch.setenv("COLUMNS", "70")
    narrow = fc.scenes.summary(tree)
    assert len(narrow.splitlines()) <= 36
    assert "tables left out: 1;" in narrow
    assert "rigid" in narrow
    assert "scatter" not in narrow
    monkeypatch.setenv("COLUMNS", "110")
    assert "scatter of the profiles" in fc.scenes.summary(tree)
