"""Methods and tolerances picked for an error or a time: the error is kept, and asking for less costs less."""

import numpy as np
import pytest
from study import SOUND, command

import fractalcontact as fc
from fractalcontact.accuracy import curves
from fractalcontact.base.errors import FractalContactWarning, InvalidInput
from fractalcontact.scenes.choosing import choose

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


FACES = {
    "periodic": ("spectral", "rms_slope = 0.1\nshort_cutoff = 6e-5", ""),
    "free": ("fbm", "rms_increment = 1e-6", 'boundary = "free"'),
}


@pytest.mark.parametrize("kind", list(FACES))
def test_the_error_asked_for_is_kept_and_less_costs_less(tmp_path, kind):
    exact = pressed(tmp_path, "", FACES[kind][0], FACES[kind][1], FACES[kind][2] + "\ntolerance = 1e-13")[
        "contact"
    ]
    transforms, errors = [], []
    for error in (1e-1, 1e-2, 1e-3, 1e-4):
        found = pressed(tmp_path, f"error = {error}", *FACES[kind])
        assert "contact.tolerance" in found.attrs["picked"]
        difference = (found["contact/pressure"] - exact["pressure"]).values
        errors.append(np.sqrt((difference**2).mean() / (exact["pressure"].values ** 2).mean()))
        assert errors[-1] <= error
        transforms.append(int(found["contact/transforms"].sum()))
    assert transforms == sorted(transforms)
    assert transforms[0] < transforms[-1]
    assert transforms[-1] < int(exact["transforms"].sum())


@pytest.mark.parametrize(("load", "contest"), [("nominal_pressure", ""), ("closure", ", closure imposed")])
def test_the_curve_is_that_of_the_load(tmp_path, load, contest):
    text = PRESSED.format(top="error = 1e-4", generator=FACES["free"][0], amplitude=FACES["free"][1],
                          boundary='boundary = "free"').replace("nominal_pressure", load)  # fmt: skip
    (tmp_path / "pressed.toml").write_text(text, encoding="utf-8")
    _, (picked,) = choose(fc.scenes.load(tmp_path / "pressed.toml"))
    (curve,) = curves.shipped()[f"rough, free body{contest}"].values()
    at = curve.knob.index(picked.option.value)
    assert picked.option.error == pytest.approx(3 * max(curve.error[at:]))


def scene(tmp_path, top, **changes):
    text = top + SOUND.replace(
        "joints = [", 'dimensions = ["default", "spectrum"]\ndomains = ["box_dimension"]\njoints = ['
    )
    for old, new in changes.items():
        text = text.replace(old, new)
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    return fc.scenes.load(tmp_path / "study.toml")


def test_the_plan_says_what_was_picked(tmp_path):
    with pytest.warns(FractalContactWarning, match="out of reach: want.dimensions comes to 0.0"):
        told = str(fc.scenes.plan(scene(tmp_path, "error = 1e-3\n")))
    for key in ("joint.tolerance", "want.dimensions", "domains.box_dimension.cover"):
        assert f"picked: {key} = " in told
    assert "the least there is" in told  # no estimator comes within .001 on a face of 48 x 48
    assert "picked" not in str(fc.scenes.plan(scene(tmp_path, "")))


@pytest.mark.filterwarnings("ignore:an error of")
def test_a_looser_error_picks_the_quicker_estimator(tmp_path):
    picked = {}
    for error in (0.3, 1e-4):
        found, _ = choose(scene(tmp_path, f"error = {error}\n"))
        picked[error] = found.wanted("dimensions")[0]
        assert set(found.wanted("dimensions")) >= {"spectrum"}
    seconds = {name: curve.at(48.0)[1] for name, curve in curves.shipped()["Hurst exponent"].items()}
    assert seconds[picked[0.3]] < seconds[picked[1e-4]]


@pytest.mark.filterwarnings("ignore:an error of", "ignore:a budget of")
@pytest.mark.parametrize(
    ("key", "wishes"), [("error", 10.0 ** -np.arange(1, 13)), ("budget", 10.0 ** np.arange(-2, 5))]
)
def test_asking_for_more_never_costs_less_and_never_errs_more(tmp_path, key, wishes):
    costs, errors = [], []
    for wish in wishes:
        _, choices = choose(scene(tmp_path, f"{key} = {wish}\n"))
        costs.append(sum(choice.option.seconds for choice in choices))
        errors.append(max(choice.option.error for choice in choices if choice.key.endswith("tolerance")))
    assert costs == sorted(costs)
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 1e-9  # the largest budget buys the least error that there is


def test_a_scene_without_a_choice_says_so(tmp_path):
    text = "budget = 3\n" + SOUND.replace('"closure", ', "")
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    with pytest.warns(FractalContactWarning, match="nothing is left to be picked"):
        assert choose(fc.scenes.load(tmp_path / "study.toml"))[1] == ()


@pytest.mark.filterwarnings("ignore:an error of")
def test_what_the_scene_states_is_left(tmp_path):
    stated = scene(tmp_path, "error = 1e-2\n", **{"block = 2.4e-3": "block = 2.4e-3\ntolerance = 1e-7"})
    found, choices = choose(stated)
    assert found.table("joint")["tolerance"] == 1e-7
    assert "joint.tolerance" not in [choice.key for choice in choices]
    assert "tolerance" not in scene(tmp_path, "error = 1e-2\n").table("joint")


def test_a_budget_is_kept_by_the_curves_and_more_buys_more(tmp_path):
    least = sum(one.option.seconds for one in choose(scene(tmp_path, "error = 0.9\n"))[1])
    errors = []
    for budget in (1.01 * least, 2 * least, 100 * least):
        _, choices = choose(scene(tmp_path, f"budget = {budget}\n"))
        assert sum(choice.option.seconds for choice in choices) <= budget
        errors.append(sum(choice.option.error for choice in choices))
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.5 * errors[0]
    with pytest.warns(FractalContactWarning, match="at the least"):
        choose(scene(tmp_path, f"budget = {0.5 * least}\n"))


@pytest.mark.parametrize(
    "top", ["error = 2\n", "error = 0\n", "budget = -1\n", "error = 1e-2\nbudget = 3\n", 'error = "small"\n']
)
def test_wrong_wishes_are_refused(tmp_path, top):
    with pytest.raises(InvalidInput, match="error|budget"):
        scene(tmp_path, top)


def test_the_command_tells_it_in_the_plan_the_summary_and_the_file(tmp_path):
    scene(tmp_path, "error = 0.05\n")
    done = command("run", tmp_path / "study.toml", "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "picked: joint.tolerance" in done.stdout
    assert "joint.tolerance" in command("info", tmp_path / "out" / "result.nc").stdout


def test_the_shipped_curves_are_those_of_the_methods_that_exist():
    found = curves.shipped()
    assert set(found["Hurst exponent"]) == set(fc.dimensions.methods())
    for contest in found.values():
        for curve in contest.values():
            assert len(curve.knob) == len(curve.error) == len(curve.seconds) >= 1
    assert curves.FILE.stat().st_size < 20_000


def test_a_curve_is_a_power_law_between_its_knobs():
    curve = curves.Curve((10.0, 40.0), (0.1, 0.025), (1.0, 16.0))
    error, seconds = curve.at(20.0)
    assert error == pytest.approx(0.05)
    assert seconds == pytest.approx(4.0)
    assert curve.at(80.0) == (pytest.approx(0.025), pytest.approx(64.0))
