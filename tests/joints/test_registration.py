"""Registration of two faces: known motions, noise, gaps, and the measured gneiss pair."""

import functools
import json
import os
from pathlib import Path

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import ConvergenceWarning

S = 3e-4
DATA = os.environ.get("FRACTALCONTACT_DATA", "")
measured = pytest.mark.skipif(not DATA, reason="FRACTALCONTACT_DATA is not set")


def moved_pair(rough, shift, *, noise=0.0, seed=3, angle=0.0, size=120):
    """Return lower and upper heights; moving the upper face by `shift` cells (y, x) mates them.

    Made on a larger periodic plane, band-limited, and cut out of its middle.
    """
    n = size + 100
    plane = 1e-3 * rough((n, n), seed)
    q = 2 * np.pi * np.fft.fftfreq(n)
    modes = np.fft.fft2(plane) * np.exp(1j * (q[:, None] * shift[0] + q[None, :] * shift[1]))
    upper = np.fft.ifft2(modes).real
    cut = slice(50, 50 + size)
    if angle:
        from scipy.ndimage import map_coordinates

        y, x = np.indices((n, n)) - (n - 1) / 2
        turn = np.radians(angle)
        places = np.cos(turn) * y + np.sin(turn) * x, -np.sin(turn) * y + np.cos(turn) * x
        upper = map_coordinates(upper, np.stack(places) + (n - 1) / 2, order=5, mode="grid-wrap")
    rng = np.random.default_rng(seed + 1)
    return plane[cut, cut], upper[cut, cut] + 5e-4 + noise * 1e-3 * rng.standard_normal((size, size))


@pytest.mark.parametrize("shift", [(0.5, 0.5), (-17.25, 9.0), (25.0, 30.4)])
def test_known_shift_is_recovered(make_face, rough, shift):
    lower, upper = moved_pair(rough, shift)
    result = fc.joints.register(make_face(lower, S), make_face(upper, S))
    assert result.shift_y / S == pytest.approx(shift[0], abs=2e-3)
    assert result.shift_x / S == pytest.approx(shift[1], abs=2e-3)
    assert result.rotation == pytest.approx(0, abs=5e-3)
    assert result.converged
    # the mean aperture over the common part stays as measured
    seen = np.isfinite(result.height.values)
    assert np.nanmean(result.aperture) == pytest.approx(5e-4, abs=2e-6)
    np.testing.assert_allclose((result.height - lower).values[seen], 5e-4, atol=8e-5)
    assert result.correlation > 0.999


@pytest.mark.parametrize("angle", [6.0, 20.0])
def test_rotation_beyond_a_few_degrees_is_refused(make_face, rough, angle):
    lower, upper = (make_face(face, S) for face in moved_pair(rough, (2.0, -3.0), angle=angle, size=90))
    if angle > 10:
        # too far for the first guess: an error, or a warning that the position is not determined
        with pytest.raises((ValueError, ConvergenceWarning), match="turned by a few degrees at most"):
            fc.joints.register(lower, upper)
    else:
        assert fc.joints.register(lower, upper).rotation == pytest.approx(angle, abs=0.02)


def test_unobserved_heights_stay_missing(make_face, rough):
    lower, upper = moved_pair(rough, (4.0, -3.0))
    result = fc.joints.register(make_face(lower, S), make_face(upper, S))
    np.testing.assert_allclose(result.height[5:-1, 1:-4], lower[5:-1, 1:-4] + 5e-4, atol=1e-6)
    assert np.isnan(result.height[:4]).all()
    assert np.isnan(result.height[:, -3:]).all()
    assert result.common_fraction == pytest.approx(116 * 117 / 120**2, abs=0.02)


@pytest.mark.parametrize("angle", [0.7, -3.0])
def test_known_rotation_is_recovered(make_face, rough, angle):
    lower, upper = moved_pair(rough, (0.0, 0.0), angle=angle, size=90)
    result = fc.joints.register(make_face(lower, S), make_face(upper, S))
    assert result.rotation == pytest.approx(angle, abs=0.01)
    assert np.hypot(result.shift_x, result.shift_y) < 0.02 * S
    still = fc.joints.register(make_face(lower, S), make_face(upper, S), rotation=False)
    assert still.rotation == 0
    assert still.mismatch > 3 * result.mismatch


def test_rotation_is_anticlockwise(make_face):
    # a hump east of the middle of the lower face, north of it on the upper: it must rotate clockwise
    y, x = np.indices((61, 61)) - 30.0
    hump = lambda v, u: np.exp(-((y - v) ** 2 + (x - u) ** 2) / 60)  # noqa: E731
    turn = np.radians(4)
    lower = hump(0, 18) - hump(0, -18) + 0.5 * hump(18, 0)
    c, s = np.cos(turn), np.sin(turn)
    upper = hump(18 * s, 18 * c) - hump(-18 * s, -18 * c) + 0.5 * hump(18 * c, -18 * s)
    result = fc.joints.register(make_face(lower), make_face(upper))
    assert result.rotation == pytest.approx(-4, abs=0.02)


def test_tilt_is_removed(make_face, rough):
    lower, upper = moved_pair(rough, (2.4, 0.0))
    y, x = np.indices(lower.shape) * S
    result = fc.joints.register(make_face(lower, S), make_face(upper + 0.05 * x - 0.02 * y, S))
    assert result.tilt_x == pytest.approx(-0.05, abs=1e-4)
    assert result.tilt_y == pytest.approx(0.02, abs=1e-4)
    assert result.mismatch < 1e-5
    left = fc.joints.register(make_face(lower, S), make_face(upper + 2e-3 * x, S), tilt=False)
    assert left.tilt_x == 0
    assert left.mismatch == pytest.approx(2e-3 * 120 * S / np.sqrt(12), rel=0.1)


def test_different_extents_and_origins(make_face, rough):
    lower, upper = moved_pair(rough, (1.5, -2.0))
    cut = upper[10:100, 20:110]
    result = fc.joints.register(make_face(lower, S), make_face(cut, S, origin=(10 * S, 20 * S)))
    assert result.shift_y / S == pytest.approx(1.5, abs=2e-3)
    assert result.shift_x / S == pytest.approx(-2.0, abs=2e-3)
    assert result.height.shape == lower.shape


def test_missing_heights_and_damage(make_face, rough):
    lower, upper = moved_pair(rough, (3.3, 1.6), noise=0.01)
    lower[30:45, 60:70] = np.nan
    upper[80:90, 10:25] = np.nan
    upper[50:62, 20:40] -= 2e-3  # a piece broken out
    result = fc.joints.register(make_face(lower, S), make_face(upper, S))
    assert result.shift_y / S == pytest.approx(3.3, abs=0.02)
    assert result.shift_x / S == pytest.approx(1.6, abs=0.02)
    assert np.isnan(result.aperture.values[30:45, 60:70]).all()
    assert np.isnan(result.height.values[84:93, 13:25]).all()


def test_units_of_height_change_nothing(make_face, rough):
    lower, upper = moved_pair(rough, (1.5, -2.0), noise=0.02, size=80)
    result = fc.joints.register(make_face(lower, S), make_face(upper, S))
    scaled = fc.joints.register(make_face(lower * 2.0**30, S), make_face(upper * 2.0**30, S))
    assert scaled.shift_x == result.shift_x
    assert scaled.rotation == result.rotation
    np.testing.assert_array_equal(scaled.height, result.height * 2.0**30)


def test_registered_pair_makes_a_crack(make_face, rough):
    lower, upper = moved_pair(rough, (1.5, -2.0), noise=0.02)
    result = fc.joints.register(make_face(lower, S), make_face(upper, S))
    crack = fc.joints.Crack(make_face(lower, S), result.height, young=60e9, poisson=0.2, block=80 * S)
    opening = fc.joints.dilatancy(crack, shear=[0.0, S, 4 * S])
    assert np.isfinite(opening.rigid_dilatancy).all()


def test_invalid_arguments_are_refused(make_face, rough):
    lower, upper = moved_pair(rough, (0.0, 0.0), size=60)
    x = np.indices(lower.shape)[1] * 1.0
    for bad in (np.zeros_like(lower), 0.1 * x, np.sin(0.3 * x)):
        with pytest.raises(ValueError, match="fixes the position"):
            fc.joints.register(make_face(bad), make_face(bad))
    with pytest.raises(ValueError, match=r"upper.y.*spacing"):
        fc.joints.register(make_face(lower, S), make_face(upper, 2 * S))
    with pytest.raises(ValueError, match="rotation"):
        fc.joints.register(make_face(lower, (S, 2 * S)), make_face(upper, (S, 2 * S)))
    with pytest.raises(ValueError, match="lower"):
        fc.joints.register(make_face(lower[:5], S), 3)
    with pytest.raises(ValueError, match="upper: expected heights"):
        fc.joints.register(make_face(lower, S), make_face(upper * np.nan, S))


def test_unequal_spacings_without_rotation(make_face, rough):
    lower, upper = moved_pair(rough, (1.5, -2.0), size=80)
    result = fc.joints.register(make_face(lower, (S, 2 * S)), make_face(upper, (S, 2 * S)), rotation=False)
    assert result.shift_y / S == pytest.approx(1.5, abs=2e-3)
    assert result.shift_x / (2 * S) == pytest.approx(-2.0, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("noise_type", ["white", "patches"])
def test_standard_errors_match_the_scatter(make_face, rough, noise_type):
    from scipy.ndimage import gaussian_filter

    scores = []
    for seed in range(60):
        lower, upper = moved_pair(
            rough, (1.5, -2.0), seed=seed, noise=0.05 * (noise_type == "white"), size=100
        )
        if noise_type == "patches":
            noise = gaussian_filter(np.random.default_rng(seed).standard_normal(upper.shape), 3.0)
            upper = upper + 2e-4 * noise / noise.std()
        result = fc.joints.register(make_face(lower, S), make_face(upper, S))
        scores.append((result.shift_y.item() - 1.5 * S) / result.shift_y_error.item())
        scores.append((result.shift_x.item() + 2.0 * S) / result.shift_x_error.item())
        scores.append(result.rotation.item() / result.rotation_error.item())
    # the spread of a score of unit variance over 180 of them is 5 %
    assert 0.8 < np.std(scores) < 1.25
    assert abs(np.mean(scores)) < 0.3


@pytest.fixture(scope="module")
def gneiss(make_face):
    faces = {}
    for name in ("side_a", "side_b", "aperture"):
        stem = Path(DATA) / f"freiberg_gneiss_{name}"
        spacing = json.loads(stem.with_suffix(".json").read_text())["dx"]
        faces[name] = make_face(np.load(stem.with_suffix(".npy")), spacing)
    return faces


@pytest.fixture(scope="module")
def mated(gneiss):
    """Return a function: the filled faces and their registration, as scanned or despiked; each done once."""

    @functools.cache
    def register(despiked):
        faces = [gneiss[side] for side in ("side_a", "side_b")]
        faces = [fc.surfaces.despike(face) for face in faces] if despiked else faces
        lower, upper = map(fc.surfaces.fill, faces)
        return faces, lower, fc.joints.register(lower, upper)

    return register


@measured
def test_gneiss_pair_is_mated(gneiss):
    lower, upper = gneiss["side_a"], gneiss["side_b"]
    result = fc.joints.register(lower, upper)
    before = np.nanstd(upper - lower)
    seen = np.isfinite((upper - lower).values)
    correlation = np.corrcoef(lower.values[seen], upper.values[seen])[0, 1]
    assert result.converged
    assert result.mismatch < before
    assert result.correlation > correlation
    assert result.correlation == pytest.approx(0.98, abs=0.005)
    # the scans share a frame: less than two points and half a degree
    assert max(abs(result.shift_x), abs(result.shift_y)) < 2 * S
    assert abs(result.rotation) < 0.5
    assert np.nanmean(result.aperture) == pytest.approx(0.637e-3, rel=0.03)


@measured
def test_despiked_gneiss_closes_to_the_published_aperture(gneiss, mated):
    aperture = gneiss["aperture"]
    published = np.sort(aperture.values[np.isfinite(aperture.values)])
    closed, removed = {}, []
    for name, despiked in (("as scanned", False), ("despiked", True)):
        faces, lower, result = mated(despiked)
        removed += [int(face.removed_points) for face in faces if "removed_points" in face.coords]
        crack = fc.joints.Crack(lower, result.height, young=60e9, poisson=0.2, block=0.045)
        closing = fc.joints.closure(crack, shear=0.0, normal_force=[1e4])
        closed[name] = (result, float(closing.interface_closure.item()), float(closing.mean_gap.item()))
    assert all(0 < count < 0.015 * aperture.size for count in removed)
    scanned, clean = closed["as scanned"], closed["despiked"]
    assert float(clean[0].mismatch) < float(scanned[0].mismatch)
    assert np.nanmean(clean[0].aperture) == pytest.approx(published.mean(), rel=0.03)
    # the 0.5 % quantile is closer to that of the published aperture without the spikes
    low = published[published.size // 200]
    lowest = [float(np.nanquantile(case[0].aperture, 0.005)) for case in (clean, scanned)]
    assert abs(lowest[0] - low) < 0.5 * abs(lowest[1] - low)
    # single points held the faces apart by more than their mean aperture
    assert clean[1] < 0.4 * scanned[1]
    assert clean[2] < 1.2 * published.mean() < scanned[2]


@measured
def test_cliff_locks_the_gneiss_pair_towards_west(gneiss, mated):
    faces = {side: gneiss[f"side_{side}"].values for side in "ab"}
    for heights in faces.values():  # 14 mm long, a few millimetres high, steeper than 70 degrees, as scanned
        falls = -np.diff(heights[50:95, 154:168], axis=1)
        assert np.nanmedian(np.nanmax(falls, axis=1)) > np.tan(np.radians(70)) * 3e-4
        assert np.ptp(np.quantile(154 + np.nanargmax(np.nan_to_num(falls), axis=1), [0.1, 0.9])) <= 5
    _, lower, registered = mated(True)
    upper = registered.height
    climbs = {}
    for name, part in (("whole", slice(None)), ("west of it", slice(0, 156))):
        faces = (lower.isel(x=part), upper.isel(x=part))
        crack = fc.joints.Crack(*faces, young=60e9, poisson=0.2, block=(0.045, 0.0384))
        lifted = fc.joints.dilatancy(crack, shear=6e-4, direction=["E", "W"]).rigid_dilatancy.squeeze()
        climbs[name] = lifted.values
    assert climbs["whole"][1] > 1.5e-3 > 5 * climbs["whole"][0]
    assert climbs["west of it"][1] < 0.2e-3


@measured
def test_study_of_the_gneiss_pair(mated):
    _, lower, registered = mated(False)
    crack = fc.joints.Crack(lower, registered.height, young=60e9, poisson=0.2, block=0.045)
    shear = [0.0, 3e-4, 1.5e-3]
    opening = fc.joints.dilatancy(crack, shear=shear, direction=("E", "W"), normal_force=[1e3, 1e4])
    closing = fc.joints.closure(crack, shear=shear, normal_force=[1e3, 1e4], keep=("gap",))
    flow = fc.joints.transmissivity(closing.gap)
    strength = fc.joints.friction(opening)
    for result in (opening, closing, flow):
        for name, variable in result.data_vars.items():
            if variable.dtype.kind == "f":
                assert np.isfinite(variable).all(), name
    assert np.isfinite(strength.friction_angle).all()
    assert (opening.dilatancy < opening.rigid_dilatancy).all()
    assert (flow.hydraulic_aperture > 0).all()
    assert flow.percolates.all()


@pytest.mark.parametrize("seed", [11, 12, *(pytest.param(n, marks=pytest.mark.slow) for n in (13, 14))])
def test_motion_is_recovered_with_noise_and_gaps(make_face, rough, seed):
    rng = np.random.default_rng(seed)
    shift, angle = rng.uniform(-8, 8, 2), float(rng.uniform(-2, 2))
    noise = 0.02
    lower, upper = moved_pair(rough, shift, noise=noise, seed=seed, angle=angle, size=130)
    tilt_y, tilt_x = rng.uniform(-0.05, 0.05, 2)
    y, x = np.indices(upper.shape) * S
    upper = upper - tilt_y * y - tilt_x * x
    lower[20:30, 60:75], upper[80:84, 30:60] = np.nan, np.nan
    # the upper face covers two thirds of the lower one
    part = make_face(upper, S).isel(y=slice(0, 100), x=slice(25, 130))
    result = fc.joints.register(make_face(lower, S), part)
    assert result.converged
    assert result.rotation == pytest.approx(angle, abs=4 * float(result.rotation_error) + 5e-3)
    assert result.tilt_x == pytest.approx(tilt_x, abs=2e-3)
    assert result.tilt_y == pytest.approx(tilt_y, abs=2e-3)
    for name, cells in zip(("shift_y", "shift_x"), shift, strict=True):
        allowed = 4 * float(result[f"{name}_error"]) / S + 5e-3
        assert result[name] / S == pytest.approx(cells, abs=allowed), name
    # the mismatch is the noise, slightly smoothed by the interpolation
    assert 0.6 * noise * 1e-3 < result.mismatch < 1.3 * noise * 1e-3
    assert result.correlation > 0.995
    assert 0.5 < result.common_fraction < 0.75


def test_swapped_faces_are_refused(make_face, rough):
    lower, upper = (make_face(face, S) for face in moved_pair(rough, (3.0, -2.0), noise=0.02, size=80))
    assert fc.joints.register(lower, upper).aperture.mean() > 0
    with pytest.raises(ValueError, match=r"swap lower and upper.*mean aperture of -0\.0005 m"):
        fc.joints.register(upper, lower)
    # faces without an aperture are mated, whatever the sign of the rest
    for rest in (1e-9, -1e-9):
        assert fc.joints.register(lower, upper - 5e-4 + rest).converged


@pytest.mark.parametrize("axis", [pytest.param("x", marks=pytest.mark.slow), "y"])
def test_face_scanned_face_up_is_recognised_and_turned_over(make_face, rough, axis):
    lower, upper = moved_pair(rough, (3.0, -2.0), noise=0.02, size=70)
    turned = -upper[::-1] if axis == "x" else -upper[:, ::-1]
    faces = make_face(lower, S), make_face(turned, S)
    with pytest.raises(ValueError, match=f"scanned face up: it fits with turn_upper='{axis}'"):
        fc.joints.register(*faces)
    result = fc.joints.register(*faces, turn_upper=axis)
    plain = fc.joints.register(faces[0], make_face(upper, S))
    np.testing.assert_allclose(result.height, plain.height, atol=1e-12)
    assert result.shift_x / S == pytest.approx(-2.0, abs=0.05)
    other = "y" if axis == "x" else "x"
    with pytest.raises(ValueError, match=f"turn_upper: .* got '{other}': it fits with turn_upper='{axis}'"):
        fc.joints.register(*faces, turn_upper=other)
    with pytest.raises(ValueError, match=f"got '{axis}': it fits without turn_upper"):
        fc.joints.register(faces[0], make_face(upper, S), turn_upper=axis)


def test_faces_of_different_joints_fit_neither_way(make_face, rough):
    faces = make_face(1e-3 * rough((80, 80), 1), S), make_face(1e-3 * rough((80, 80), 2), S)
    with pytest.raises((ValueError, ConvergenceWarning), match="position"):
        fc.joints.register(*faces)


@pytest.mark.slow
@measured
def test_swapped_and_turned_gneiss_is_refused():
    lower, upper = (
        fc.surfaces.fill(fc.surfaces.read(Path(DATA) / f"freiberg_gneiss_side_{side}.npy", spacing=S))
        for side in "ab"
    )
    with pytest.raises(ValueError, match="swap lower and upper"):
        fc.joints.register(upper, lower)
    with pytest.raises(ValueError, match="turn_upper='y'"):
        fc.joints.register(lower, upper.copy(data=-upper.values[:, ::-1]))
