"""The summary: mean and deviation of the members, numbers that can be read, as wide as the screen."""

import json
import re

import numpy as np
import pytest
import xarray as xr
from study import SOUND, command_here

import fractalcontact as fc

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


def rows(text, head):
    """Return the cells of the rows of the table with this head."""
    lines = text[text.index(head) :].split("\n\n")[0].splitlines()
    return [re.split(r"  +", line) for line in lines[2:] if not line.startswith("  ")]


def test_summary_shows_mean_and_deviation_of_the_members(ensemble):
    text = fc.scenes.summary(ensemble)
    assert "ensemble of 4 members: mean ± standard deviation" in text
    percent = ensemble["joints/closure"].contact_fraction.isel(step=-1).values * 100
    for column, cells in enumerate(rows(text, "closure at shear")):
        mean, spread = (float(word) for word in cells[4].removesuffix(" %").split(" ± "))
        assert mean == pytest.approx(percent[:, column].mean(), rel=0.05)
        assert spread == pytest.approx(percent[:, column].std(ddof=1), rel=0.05)
    dimension = ensemble["dimensions"].fractal_dimension.values[:, 0]
    assert rows(text, "fractal dimension")[0][1] == f"{dimension.mean():.3f} ± {dimension.std(ddof=1):.3f}"


def test_loads_of_all_members_have_no_deviation(ensemble):
    assert rows(fc.scenes.summary(ensemble), "closure at shear")[0][1] == "10 N"


def test_peak_strength_states_its_distance_and_its_form(ensemble):
    """The energy form by hand: secants of delta + U/N over the distance, for every member and force."""
    words = " ".join(fc.scenes.summary(ensemble).split())
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
    words = " ".join(fc.scenes.summary(xr.DataTree.from_dict({"joints/friction": friction})).split())
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
    text = fc.scenes.summary(xr.DataTree.from_dict({"joints/friction": friction}))
    assert "none: the faces lock" in text
    assert "distance" not in text
    assert "°" not in text


def test_standard_errors_of_the_members_are_a_span(ensemble):
    errors = ensemble["dimensions"].standard_error.values[:, 0]
    ends = dict.fromkeys(f"{end:.4f}" for end in (errors.min(), errors.max()))
    line = next(line for line in fc.scenes.summary(ensemble).splitlines() if "error of H" in line)
    assert line.split("standard error of H ")[1].strip() == " to ".join(ends)


def test_single_study_names_no_members(ensemble):
    single = ensemble.map_over_datasets(lambda dataset: dataset.isel(member=1, missing_dims="ignore"))
    text = fc.scenes.summary(single)
    assert "members" not in text
    assert "±" not in text
    fraction = float(single["joints/closure"].contact_fraction[0, -1])
    assert rows(text, "closure at shear")[0][4] == f"{fraction * 100:.3g} %"


def test_members_without_a_value_are_counted(ensemble):
    holed = ensemble.copy()
    closing = holed["joints/closure"].to_dataset()
    closing["closure"] = closing["closure"].where(closing["member"] != 2)
    closing["interface_closure"] = closing["interface_closure"].where(False)
    holed["joints/closure"] = xr.DataTree(closing)
    cells = rows(fc.scenes.summary(holed), "closure at shear")[0]
    assert cells[2].endswith("µm (3 of 4)")
    assert cells[3] == "-"


def test_member_compared_with_the_paper_is_named(ensemble):
    tree = ensemble.copy()
    scene = json.loads(tree.attrs["provenance"])
    scene["parameters"]["scene"]["paper"] = True
    tree.attrs["provenance"] = json.dumps(scene)
    assert "member 0 of 4" in fc.scenes.summary(tree)


@pytest.mark.parametrize("columns", [80, 160])
def test_summary_plan_and_contents_fit_the_screen(ensemble, columns, monkeypatch, tmp_path):
    monkeypatch.setenv("COLUMNS", str(columns))
    path = fc.save(ensemble, tmp_path / "result.nc")
    plan = str(fc.scenes.plan(fc.scenes.load("concrete_crack")))
    for text in (fc.scenes.summary(ensemble), fc.scenes.contents(path), plan):
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


def test_boxes_of_the_dimension_are_named(ensemble):
    boxes = ensemble["domains/box_dimension"].to_dataset().isel(step=-1)
    expected = [
        f"{float(each.scale_min.min()):g} ... {float(each.scale_max.max()):g}"
        for each in (boxes.isel(shear=0), boxes.isel(shear=-1))
    ]
    cells = rows(fc.scenes.summary(ensemble), "contact domain, last step")
    assert [row[3] for row in (cells[0], cells[-1])] == expected


def test_units_follow_the_values():
    surface = fc.surfaces.spectral((32, 32), 1e-7, hurst=0.8, rms_slope=0.1, rng=1)
    pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e6, 1e7])
    text = fc.scenes.summary(xr.DataTree.from_dict({"contact": pressed}))
    assert [cells[1] for cells in rows(text, "step")] == ["1 MPa", "10 MPa"]
    assert rows(text, "step")[0][2].endswith(" nm")
    assert "e+0" not in text


def test_column_has_one_unit_within_three_decades():
    surface = fc.surfaces.spectral((32, 32), 1e-7, hurst=0.8, rms_slope=0.1, rng=1)
    for pressures, shown in (([4e5, 6e5], ["0.4 MPa", "0.6 MPa"]), ([1e3, 1e7], ["1 kPa", "10 MPa"])):
        pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=pressures)
        text = fc.scenes.summary(xr.DataTree.from_dict({"contact": pressed}))
        assert [cells[1] for cells in rows(text, "step")] == shown


def test_transmissivity_of_parallel_plates_in_two_units():
    """Plates 0.1 mm apart: w^3/12 = 8.33e-14 m3, times 998.2 kg/m3 9.81 m/s2 / 1.002 mPa s = 8.14e-7 m2/s."""
    gap = fc.surfaces.from_array(np.full((8, 8), 1e-4), 1e-3).expand_dims(step=[0])
    flow = fc.joints.transmissivity(gap.assign_coords(normal_force=("step", [5.0], {"units": "N"})))
    text = " ".join(fc.scenes.summary(xr.DataTree.from_dict({"joints/transmissivity": flow})).split())
    assert "cubed over 12: 8.33e-14 m³; times unit weight over viscosity" in text
    assert "for water at 20 °C, 8.14e-07 m²/s" in text


def test_small_forces_are_not_zero_kilonewton():
    face = fc.surfaces.fbm((32, 32), 1e-7, hurst=0.8, rms_increment=3e-9, rng=1)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=16e-7)
    closing = fc.joints.closure(crack, shear=[2e-7], normal_force=[2e-6])
    cells = rows(fc.scenes.summary(xr.DataTree.from_dict({"joints/closure": closing})), "closure at shear")[0]
    assert cells[:2] == ["200 nm", "2 µN"]
    text = " ".join(fc.scenes.summary(xr.DataTree.from_dict({"joints/closure": closing})).split())
    assert f"the last step of the load, {2e-6 / 16e-7**2 / 1e6:.3g} MPa on the area of the block" in text


def test_no_negative_zero_and_no_contradiction_beside_the_dimension():
    mask = np.zeros((2, 64, 64), bool)
    mask[:, ::16, ::16] = True
    mask[1, 20:24, 20:24] = True
    state = xr.DataArray(mask, dims=("shear", "y", "x"), coords={"shear": [1e-4, 2e-4]})
    for dim in ("y", "x"):
        state = state.assign_coords({dim: (dim, np.arange(64) * 1e-5, {"units": "m"})})
    boxes = fc.domains.box_dimension(state)
    text = fc.scenes.summary(xr.DataTree.from_dict({"domains/box_dimension": boxes}))
    assert "-0.00" not in text
    words = " ".join(text.split())
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
    text = fc.scenes.summary(tree)
    rows = {line.split()[0]: line for line in text.splitlines() if line.strip()}
    assert rows["Sq"].endswith(f"{float(statistics.rms_height) * 1e6:.3g} µm")
    assert rows["Sdq"].endswith(f"{float(statistics.rms_slope):.3f}")
    assert rows["E"].split()[1] == f"{float(jrc.roughness_coefficient[0]):.1f}"
    assert "Azimuths are from E (+x) anticlockwise" in " ".join(text.split())
    metric = rose.roughness_metric
    assert rows["largest"].split()[1:] == [
        f"{float(metric.azimuth[int(metric.argmax('azimuth'))]):g}°", f"{float(metric.max()):.2f}°"
    ]  # fmt: skip


@pytest.mark.parametrize(("increment", "outside"), [(1e-8, True), (3e-5, False)])
def test_coefficient_beyond_the_standard_profiles_is_told(increment, outside):
    surface = fc.surfaces.fbm((64, 64), 2e-4, hurst=0.7, rms_increment=increment, rng=3)
    jrc = fc.joints.roughness_coefficient(surface)
    text = fc.scenes.summary(xr.DataTree.from_dict({"/joints/roughness_coefficient": jrc}))
    assert bool((jrc.scale_position != 0).any()) is outside
    assert ("is extrapolated" in " ".join(text.split())) is outside
