"""The delta-surface: exact and fractional shifts, interpolation error, missing heights."""

import numpy as np
import pytest

import fractalcontact as fc

MATERIAL = {"young": 30e9, "poisson": 0.2}


def slow_delta(lower, upper, crack, shift):
    (ay, ax), (by, bx), (ny, nx) = crack.layout.start, crack.layout.cells, lower.shape
    out = np.empty((by, bx))
    for i in range(by):
        for j in range(bx):
            out[i, j] = lower[(ay + i + shift[0]) % ny, (ax + j + shift[1]) % nx] - upper[ay + i, ax + j]
    return out


@pytest.mark.parametrize(
    ("direction", "shift"), [("E", (0, 3)), ("N", (3, 0)), ("W", (0, -3)), ("S", (-3, 0))]
)
@pytest.mark.parametrize("mated", [True, False])
def test_whole_shift_is_exact(make_face, rough, direction, shift, mated):
    lower, upper = rough((21, 24), 1), rough((21, 24), 2)
    upper = lower if mated else upper
    crack = fc.joints.Crack(
        make_face(lower, 8e-5), None if mated else make_face(upper, 8e-5), block=(8e-4, 9.6e-4), **MATERIAL
    )
    delta = fc.joints.delta_surface(crack, 3 * 8e-5, direction)
    np.testing.assert_array_equal(delta.values, slow_delta(lower, upper, crack, shift))
    np.testing.assert_array_equal(delta.x, crack.lower.x[crack.layout.slices[1]])
    assert delta.dims == ("y", "x")
    assert delta.name == "height"
    assert delta.attrs["units"] == "m"
    assert "period" not in delta.x.attrs
    assert delta.direction == direction


def test_nearly_whole_shift_is_whole(make_face, rough):
    crack = fc.joints.Crack(make_face(rough((24, 24), 1), 8e-5), block=8e-4, **MATERIAL)
    exact = fc.joints.delta_surface(crack, 3 * 8e-5)
    near = fc.joints.delta_surface(crack, 3 * 8e-5 * (1 + 3e-7))
    np.testing.assert_array_equal(exact, near)
    off = fc.joints.delta_surface(crack, 3 * 8e-5 * (1 + 3e-6))
    assert np.abs(exact - off).max() > 0


def test_periodic_face_wraps_and_stays_periodic(make_face, rough):
    lower = rough((12, 16), 3)
    crack = fc.joints.Crack(make_face(lower, periodic=True), **MATERIAL)
    assert crack.travel("N") == np.inf
    delta = fc.joints.delta_surface(crack, 37.0, "W")
    np.testing.assert_array_equal(delta.values, np.roll(lower, 37, axis=1) - lower)
    assert delta.x.attrs["period"] == 16.0
    assert delta.y.attrs["period"] == 12.0


def test_block_on_a_periodic_face_wraps_and_is_free(make_face, rough):
    lower = rough((12, 16), 3)
    crack = fc.joints.Crack(make_face(lower, periodic=True), block=6, **MATERIAL)
    delta = fc.joints.delta_surface(crack, 9.0, "E")
    np.testing.assert_array_equal(delta.values, slow_delta(lower, lower, crack, (0, 9)))
    assert "period" not in delta.x.attrs


@pytest.mark.parametrize("direction", ["E", "NE", "S", 200.0])
@pytest.mark.parametrize("shear", [1.0, 2.0, 0.37, 5.5])
def test_spectrum_of_the_difference_on_a_periodic_face(make_face, rough, direction, shear):
    # odd sizes: no wave sits at the ambiguous Nyquist wavenumber
    lower = rough((45, 63), 4, hurst=0.5)
    crack = fc.joints.Crack(make_face(lower, periodic=True), **MATERIAL)
    delta = fc.joints.delta_surface(crack, shear, direction)
    angle = np.radians(float(delta.azimuth))
    qy, qx = 2 * np.pi * np.fft.fftfreq(45)[:, None], 2 * np.pi * np.fft.fftfreq(63)[None, :]
    expected = 4 * np.sin((qy * np.sin(angle) + qx * np.cos(angle)) * shear / 2) ** 2
    expected = expected * np.abs(np.fft.fft2(lower)) ** 2
    got = np.abs(np.fft.fft2(delta.values)) ** 2
    assert np.abs(got - expected).max() <= 1e-12 * expected.max()


def test_fractional_shift_of_the_nyquist_wave(make_face):
    wave = np.broadcast_to(np.cos(np.pi * np.arange(8)), (6, 8))
    crack = fc.joints.Crack(make_face(wave, periodic=True), **MATERIAL)
    delta = fc.joints.delta_surface(crack, 0.25, "E")
    np.testing.assert_allclose(delta, (np.cos(np.pi / 4) - 1) * wave, atol=1e-15)


@pytest.mark.parametrize(("direction", "shear"), [("E", 7.3), (30.0, 5.5), ("S", 0.01), (211.0, 8.2)])
def test_spline_shift_of_a_smooth_free_face(make_face, direction, shear):
    def surface(y, x):
        return np.sin(0.3 * x + 0.2 * y) + 0.01 * x - 0.02 * y

    y, x = np.mgrid[:64, :48].astype(float)
    crack = fc.joints.Crack(make_face(surface(y, x)), block=30, **MATERIAL)
    delta = fc.joints.delta_surface(crack, shear, direction)
    angle = np.radians(float(delta.azimuth))
    y, x = y[crack.layout.slices], x[crack.layout.slices]
    exact = surface(y + shear * np.sin(angle), x + shear * np.cos(angle)) - surface(y, x)
    np.testing.assert_allclose(delta, exact, atol=3e-6)
    assert 0 < delta.interpolation_error < 1e-4


def test_spline_error_falls_with_the_sixth_power(make_face):
    errors = []
    for waves in (8, 4):
        x = np.arange(400.0)
        crack = fc.joints.Crack(
            make_face(np.broadcast_to(np.cos(2 * np.pi * waves * x / 128), (5, 400))),
            block=(5, 128),
            **MATERIAL,
        )
        start = crack.layout.start[1]
        delta = fc.joints.delta_surface(crack, 0.5)
        x = x[start : start + 128]
        exact = np.cos(2 * np.pi * waves * (x + 0.5) / 128) - np.cos(2 * np.pi * waves * x / 128)
        errors.append(np.abs(delta.values - exact).max())
    assert 40 < errors[0] / errors[1] < 100


def test_quintic_is_exact_up_to_the_edge(make_face):
    x = np.arange(30.0) / 30
    heights = np.broadcast_to(x**5 - 2 * x**4 + x, (5, 30))
    crack = fc.joints.Crack(make_face(heights), block=(5, 10), **MATERIAL)
    shear = crack.travel("E") - 0.4
    moved = x[crack.layout.slices[1]] + shear / 30
    delta = fc.joints.delta_surface(crack, shear)
    exact = moved**5 - 2 * moved**4 + moved - heights[0, crack.layout.slices[1]]
    np.testing.assert_allclose(delta.values, np.broadcast_to(exact, (5, 10)), atol=1e-13)


def test_missing_heights_matter_only_in_the_path(make_face, rough):
    heights = rough((30, 30), 5)
    complete = fc.joints.Crack(make_face(heights), block=10, **MATERIAL)
    incomplete = heights.copy()
    incomplete[15, 24] = np.nan
    crack = fc.joints.Crack(make_face(incomplete), block=10, **MATERIAL)
    np.testing.assert_array_equal(fc.joints.delta_surface(crack, 3.0), fc.joints.delta_surface(complete, 3.0))
    between, expected = fc.joints.delta_surface(crack, 3.5), fc.joints.delta_surface(complete, 3.5)
    assert np.isfinite(between).all()
    # the influence of a node on a spline falls by a factor of 0.43 with every cell
    np.testing.assert_allclose(between[:, 0], expected[:, 0], atol=3 * 0.43**10)
    with pytest.raises(ValueError, match=r"lower.*fill.*1 missing.*5 m towards E"):
        fc.joints.delta_surface(crack, 5.0, "E")
    with pytest.raises(ValueError, match="missing"):
        fc.joints.delta_surface(crack, 4.5, "E")


def test_shear_beyond_the_face_names_the_travel(make_face):
    crack = fc.joints.Crack(make_face(np.zeros((20, 20))), block=10, **MATERIAL)
    with pytest.raises(ValueError, match=r"at most 5 m towards E"):
        fc.joints.delta_surface(crack, 5.1)
    with pytest.raises(ValueError, match=r"smaller `block`"):
        fc.joints.delta_surface(fc.joints.Crack(make_face(np.zeros((20, 20))), **MATERIAL), 1.0)
    with pytest.raises(ValueError, match=r"direction.*'Q'"):
        fc.joints.delta_surface(crack, 1.0, "Q")
    with pytest.raises(ValueError, match=r"shear.*>= 0"):
        fc.joints.delta_surface(crack, -1.0)


def test_sequence_of_shears_is_a_dim(make_face, rough):
    crack = fc.joints.Crack(make_face(rough((20, 20), 6)), block=10, **MATERIAL)
    stack = fc.joints.delta_surface(crack, [0.0, 2.0, 2.5], "N")
    assert stack.dims == ("shear", "y", "x")
    assert not stack.sel(shear=0.0).any()
    np.testing.assert_array_equal(stack.sel(shear=2.5), fc.joints.delta_surface(crack, 2.5, "N"))


@pytest.mark.parametrize("shear", [2.0, 2.5])
@pytest.mark.parametrize("periodic", [True, False])
def test_units_change_only_exponents(make_face, rough, shear, periodic):
    heights = rough((20, 22), 7)
    crack = fc.joints.Crack(make_face(heights, 1.0, periodic=periodic), block=10.0, **MATERIAL)
    scaled = fc.joints.Crack(
        make_face(heights * 2.0**-30, 2.0**-20, periodic=periodic), block=10 * 2.0**-20, **MATERIAL
    )
    delta = fc.joints.delta_surface(crack, shear, "N").values
    delta_scaled = fc.joints.delta_surface(scaled, shear * 2.0**-20, "N").values
    np.testing.assert_array_equal(delta * 2.0**-30, delta_scaled)


@pytest.mark.parametrize("hurst", [0.3, 0.8])
def test_interpolation_error_matches_a_finer_face(make_face, hurst):
    # a face at half the spacing holds the true heights between the points
    fine = fc.surfaces.fbm((300, 400), 0.5, hurst=hurst, rms_increment=1.0, rng=5).values
    crack = fc.joints.Crack(make_face(fine[::2, ::2]), block=(100, 100), **MATERIAL)
    delta = fc.joints.delta_surface(crack, [2.0, 2.5], ["E", "N"])
    rows, columns = (slice(2 * s.start, 2 * s.stop, 2) for s in crack.layout.slices)
    for direction, (dy, dx) in {"E": (0, 5), "N": (5, 0)}.items():
        moved = fine[rows.start + dy : rows.stop + dy : 2, columns.start + dx : columns.stop + dx : 2]
        half_way = delta.sel(direction=direction, shear=2.5)
        missed = np.sqrt(np.mean((half_way.values - (moved - fine[rows, columns])) ** 2))
        assert half_way.interpolation_error == pytest.approx(missed, rel=0.05)
    assert (delta.interpolation_error.sel(shear=2.0) == 0).all()


def test_interpolation_error_bounds_that_of_a_smooth_face(make_face):
    x = np.arange(200.0)
    for points in (4, 8, 16):
        face = make_face(np.cos(2 * np.pi * x / points + np.arange(5)[:, None]))
        delta = fc.joints.delta_surface(fc.joints.Crack(face, block=(5, 100), **MATERIAL), 0.5)
        x0 = x[50:150]
        exact = np.cos(2 * np.pi * (x0 + 0.5) / points + np.arange(5)[:, None])
        missed = np.sqrt(np.mean((delta.values - exact + face.values[:, 50:150]) ** 2))
        assert missed <= delta.interpolation_error < 200 * missed


def test_sequence_of_directions_is_a_dim(make_face, rough):
    crack = fc.joints.Crack(make_face(rough((24, 24), 6)), block=10, **MATERIAL)
    several = fc.joints.delta_surface(crack, 2.0, ["E", 90, "SW"])
    assert several.dims == ("direction", "y", "x")
    assert list(several.direction.values) == ["E", "N", "SW"]
    np.testing.assert_array_equal(several.sel(direction="N"), fc.joints.delta_surface(crack, 2.0, "N"))
    several = fc.joints.delta_surface(crack, [0.0, 2.0], ["E"])
    assert several.dims == ("direction", "shear", "y", "x")


@pytest.mark.parametrize("function", ["delta_surface", "closure", "dilatancy", "decorrelation_length"])
def test_repeated_shears_and_directions_are_refused(make_face, rough, function):
    crack = fc.joints.Crack(make_face(rough((24, 24), 6)), block=10, **MATERIAL)
    options = {"normal_force": 1.0} if function == "closure" else {}
    with pytest.raises(ValueError, match=r"shear: expected every shear once, got 2 m several times"):
        getattr(fc.joints, function)(crack, shear=[0.0, 2.0, 3.0, 2.0], **options)
    with pytest.raises(ValueError, match=r"direction: expected every direction once, got E several times"):
        getattr(fc.joints, function)(crack, shear=[0.0, 2.0], direction=["E", "N", 360], **options)
