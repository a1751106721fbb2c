"""Methods and tolerances selected for an error or a run time: the error is met, a looser one is faster."""

import numpy as np
import pytest
from study import SOUND, command_here

import fractalcontact as fc
from fractalcontact.base.errors import FractalContactWarning, InvalidInput
from fractalcontact.scenes import _autotune

PRESSED = """
{top}
[surface]
generate = "{generator}"
shape = [96, 96]
spacing = 1e-5
hurst = 0.6
{amplitude}
rng = 11
[contact]
contact_modulus = 1e9
nominal_pressure = [1e6, 1e7, 4e7]
{boundary}
[want]
contact = ["press"]
keep = ["pressure"]
"""


def pressed(folder, top, generator, amplitude, boundary):
    path = folder / "pressed.toml"
    path.write_text(
        PRESSED.format(top=top, generator=generator, amplitude=amplitude, boundary=boundary), encoding="utf-8"
    )
    return fc.scenes.run(path, progress=False)


SURFACES = {
    "periodic": ("spectral", "rms_slope = 0.1\nshort_cutoff = 6e-5", ""),
    "free": ("fbm", "rms_increment = 1e-6", 'boundary = "free"'),
}


@pytest.mark.parametrize("kind", list(SURFACES))
def test_error_is_met_and_a_looser_one_is_faster(tmp_path, kind):
    exact = pressed(
        tmp_path, "", SURFACES[kind][0], SURFACES[kind][1], SURFACES[kind][2] + "\ntolerance = 1e-13"
    )["contact"]
    transforms, errors = [], []
    for error in (1e-1, 1e-2, 1e-3, 1e-4):
        tree = pressed(tmp_path, f"error = {error}", *SURFACES[kind])
        assert "contact.tolerance" in tree.attrs["selected"]
        difference = (tree["contact/pressure"] - exact["pressure"]).values
        errors.append(np.sqrt((difference**2).mean() / (exact["pressure"].values ** 2).mean()))
        assert errors[-1] <= error
        transforms.append(int(tree["contact/transforms"].sum()))
    assert transforms == sorted(transforms)
    assert transforms[0] < transforms[-1]
    assert transforms[-1] < int(exact["transforms"].sum())


@pytest.mark.parametrize(("load", "condition"), [("nominal_pressure", ""), ("closure", ", closure imposed")])
def test_tolerance_follows_the_curve_of_the_load(tmp_path, load, condition):
    text = PRESSED.format(top="error = 1e-4", generator=SURFACES["free"][0], amplitude=SURFACES["free"][1],
                          boundary='boundary = "free"').replace("nominal_pressure", load)  # fmt: skip
    (tmp_path / "pressed.toml").write_text(text, encoding="utf-8")
    (choice,) = selected(fc.scenes.load(tmp_path / "pressed.toml"))
    (curve,) = _autotune.measured_curves()[f"rough, free body{condition}"].values()
    at = curve.parameter.index(choice.option.value)
    assert choice.option.error == pytest.approx(3 * max(curve.error[at:]))


def selected(study):
    """Return the choices of the plan of a scene."""
    return fc.scenes.plan(study).choices


def scene(tmp_path, top, **changes):
    text = top + SOUND.replace(
        "joints = [", 'dimensions = ["default", "spectrum"]\ndomains = ["box_dimension"]\njoints = ['
    )
    for old, new in changes.items():
        text = text.replace(old, new)
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    return fc.scenes.load(tmp_path / "study.toml")


def test_plan_lists_the_selection(tmp_path):
    with pytest.warns(FractalContactWarning, match="out of reach: want.dimensions reaches 0.0"):
        text = str(fc.scenes.plan(scene(tmp_path, "error = 1e-3\n")))
    for key in ("joint.tolerance", "want.dimensions", "domains.box_dimension.cover"):
        assert f"selected: {key} = " in text
    assert "the smallest error available" in text  # no estimator comes within .001 on a face of 48 x 48
    assert "selected" not in str(fc.scenes.plan(scene(tmp_path, "")))


@pytest.mark.filterwarnings("ignore:an error of")
def test_looser_error_selects_a_faster_estimator(tmp_path):
    choice_by_error = {}
    for error in (0.3, 1e-4):
        choices = selected(scene(tmp_path, f"error = {error}\n"))
        (methods,) = (choice.option.value for choice in choices if choice.key == "want.dimensions")
        choice_by_error[error] = methods[0]
        assert set(methods) >= {"spectrum"}
    seconds = {
        name: curve.at(48.0)[1] for name, curve in _autotune.measured_curves()["Hurst exponent"].items()
    }
    assert seconds[choice_by_error[0.3]] < seconds[choice_by_error[1e-4]]


@pytest.mark.filterwarnings("ignore:an error of", "ignore:a budget of")
@pytest.mark.parametrize(
    ("key", "wishes"), [("error", 10.0 ** -np.arange(1, 13)), ("budget", 10.0 ** np.arange(-2, 5))]
)
def test_tighter_requests_cost_more_and_err_less(tmp_path, key, wishes):
    costs, errors = [], []
    for wish in wishes:
        choices = selected(scene(tmp_path, f"{key} = {wish}\n"))
        costs.append(sum(choice.option.seconds for choice in choices))
        errors.append(max(choice.option.error for choice in choices if choice.key.endswith("tolerance")))
    assert costs == sorted(costs)
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 1e-9  # the largest budget buys the least error that there is


def test_scene_with_nothing_to_select_warns(tmp_path):
    text = "budget = 3\n" + SOUND.replace('"closure", ', "")
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    with pytest.warns(FractalContactWarning, match="nothing to select"):
        assert selected(fc.scenes.load(tmp_path / "study.toml")) == ()


@pytest.mark.filterwarnings("ignore:an error of")
def test_explicit_values_are_never_changed(tmp_path):
    stated = scene(tmp_path, "error = 1e-2\n", **{"block = 2.4e-3": "block = 2.4e-3\ntolerance = 1e-7"})
    assert "joint.tolerance" not in [choice.key for choice in selected(stated)]
    assert stated.table("joint")["tolerance"] == 1e-7
    assert "tolerance" not in scene(tmp_path, "error = 1e-2\n").table("joint")


def test_budget_is_kept_and_a_larger_one_reduces_the_error(tmp_path):
    least = sum(choice.option.seconds for choice in selected(scene(tmp_path, "error = 0.9\n")))
    errors = []
    for budget in (1.01 * least, 2 * least, 100 * least):
        choices = selected(scene(tmp_path, f"budget = {budget}\n"))
        assert sum(choice.option.seconds for choice in choices) <= budget
        errors.append(sum(choice.option.error for choice in choices))
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.5 * errors[0]
    with pytest.warns(FractalContactWarning, match="at least"):
        selected(scene(tmp_path, f"budget = {0.5 * least}\n"))


@pytest.mark.parametrize(
    "top", ["error = 2\n", "error = 0\n", "budget = -1\n", "error = 1e-2\nbudget = 3\n", 'error = "small"\n']
)
def test_invalid_error_or_budget_is_refused(tmp_path, top):
    with pytest.raises(InvalidInput, match="error|budget"):
        scene(tmp_path, top)


def test_selection_is_in_the_summary_and_in_the_file(tmp_path):
    scene(tmp_path, "error = 0.05\n")
    done = command_here("run", tmp_path / "study.toml", "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "selected: joint.tolerance" in done.stdout
    assert "joint.tolerance" in command_here("info", tmp_path / "out" / "result.nc").stdout


def test_shipped_curves_cover_the_methods():
    curves = _autotune.measured_curves()
    assert set(curves["Hurst exponent"]) == set(fc.dimensions.methods())
    for benchmark in curves.values():
        for curve in benchmark.values():
            assert len(curve.parameter) == len(curve.error) == len(curve.seconds) >= 1
    assert _autotune.CURVES_FILE.stat().st_size < 20_000


def test_curve_is_a_power_law_between_its_points():
    curve = _autotune.Curve((10.0, 40.0), (0.1, 0.025), (1.0, 16.0))
    error, seconds = curve.at(20.0)
    assert error == pytest.approx(0.05)
    assert seconds == pytest.approx(4.0)
    assert curve.at(80.0) == (pytest.approx(0.025), pytest.approx(64.0))
