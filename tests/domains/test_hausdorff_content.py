import numpy as np
import pytest
from domains.sets import DIMENSION, as_mask, lattice_set, random_null

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput


def content(cells, s, **options):
    return fc.domains.hausdorff_content(cells, s, **options).hausdorff_content.values


def cheapest(cells, s, side):
    """Return the cheapest cover of a square of cells by recursion over its quarters."""
    if not cells.any():
        return 0.0
    if side == 1:
        return 1.0
    half = side // 2
    parts = [cells[i : i + half, j : j + half] for i in (0, half) for j in (0, half)]
    return min(float(side) ** s, sum(cheapest(part, s, half) for part in parts))


def every_cover(cells):
    """Yield the sides of the squares of every cover of 4 x 4 cells by dyadic squares."""
    if not cells.any():
        yield ()
        return
    n = len(cells)
    yield (n,)
    if n > 1:
        parts = [
            list(every_cover(cells[i : i + n // 2, j : j + n // 2])) for i in (0, n // 2) for j in (0, n // 2)
        ]
        for a in parts[0]:
            for b in parts[1]:
                for c in parts[2]:
                    for d in parts[3]:
                        yield (*a, *b, *c, *d)


@pytest.mark.parametrize("s", [0.0, 0.7, 1.0, 1.4, 2.0])
def test_equals_the_least_over_all_covers(s):
    rng = np.random.default_rng(1)
    for _ in range(20):
        cells = rng.random((4, 4)) < rng.random()
        least = min(sum(float(side) ** s for side in cover) for cover in every_cover(cells))
        assert content(cells, s) == pytest.approx(least, rel=1e-14)


@pytest.mark.parametrize("shape", [(32, 32), (20, 32), (13, 7)])
def test_equals_recursion_over_quarters(shape):
    cells = np.random.default_rng(2).random(shape) < 0.1
    padded = np.zeros((32, 32), bool)
    padded[: shape[0], : shape[1]] = cells
    side = 2 ** int(np.ceil(np.log2(max(shape))))
    for s in (0.5, 1.0, 1.3, 1.8):
        assert content(cells, s) == pytest.approx(cheapest(padded[:side, :side], s, side), rel=1e-13)


def test_lattice_sets_have_their_measure_at_their_dimension():
    for level in (4, 5, 6):
        gasket = lattice_set("gasket", level)
        relative = fc.domains.hausdorff_content(gasket > 0, DIMENSION["gasket"]).relative_content
        assert float(relative) == pytest.approx(1.0, rel=1e-12)
        below, above = content(gasket > 0, [1.4, 1.7]) / 2.0 ** (level * np.array([1.4, 1.7]))
        assert below == pytest.approx(1.0)
        assert above == pytest.approx(3.0**level / 2.0 ** (1.7 * level), rel=1e-12)


def test_area_at_two_and_number_of_largest_squares_at_zero():
    cells = np.random.default_rng(3).random((64, 64)) < 0.2
    assert content(cells, 2.0) == cells.sum()
    counts = fc.domains.box_counts(cells, [16], cover="aligned").box_count
    assert content(cells, 0.0, coarsest=16) == float(counts[0])
    assert content(cells, [1.3], coarsest=1) == cells.sum()


def test_properties_of_a_measure():
    """Monotone in the set, subadditive, and scaled by the power s of the length."""
    rng = np.random.default_rng(4)
    first, second = (random_null(64, 300, rng) for _ in range(2))
    for s in (0.6, 1.2, 1.7):
        both = content(first | second, s)
        assert max(content(first, s), content(second, s)) <= both
        assert both <= content(first, s) + content(second, s)
        metres = content(as_mask(first, (1e-3, 1e-3)), s)
        assert metres == pytest.approx(content(first, s) * 1e-3**s, rel=1e-12)
        larger = np.kron(first, np.ones((2, 2), bool))
        assert content(larger, s) <= content(first, s) * 2**s * (1 + 1e-12)


def test_no_square_holds_more_mass_than_its_side_to_the_s():
    """The content is the largest such mass (Frostman): never above the cover by squares of any one size."""
    cells = random_null(64, 500, np.random.default_rng(5))
    sizes = 2 ** np.arange(7)
    counts = fc.domains.box_counts(cells, sizes, cover="aligned").box_count.values
    for s in (0.5, 1.0, 1.5):
        assert content(cells, s) <= (counts * sizes.astype(float) ** s).min() * (1 + 1e-12)


@pytest.mark.parametrize("wraps", [True, False])
def test_shifts_move_the_grid_of_squares(wraps):
    cells = np.zeros((64, 64), bool)
    cells[31:33, 31:33] = True  # across the middle, where four squares meet
    mask = as_mask(cells, (1.0, 1.0), periodic=(wraps, wraps))
    alone = fc.domains.hausdorff_content(mask, 1.0)
    shifted = fc.domains.hausdorff_content(mask, 1.0, shifts=16)
    assert float(alone.hausdorff_content) == 4.0  # four cells
    assert float(shifted.hausdorff_content_min) == 2.0  # one square of 2 x 2
    assert float(shifted.hausdorff_content_min) <= float(shifted.hausdorff_content)


def test_rolling_a_periodic_plane_changes_only_the_grid():
    cells = random_null(64, 200, np.random.default_rng(6))
    mask = as_mask(cells, (1.0, 1.0), periodic=(True, True))
    rolled = mask.roll(x=16, y=32, roll_coords=False)
    one, other = (fc.domains.hausdorff_content(each, 1.2, coarsest=16.0) for each in (mask, rolled))
    assert float(one.hausdorff_content) == pytest.approx(float(other.hausdorff_content), rel=1e-13)


def test_stacks_chunks_and_unobserved_cells():
    pytest.importorskip("dask")
    planes = np.array([random_null(32, k, np.random.default_rng(k)) for k in (0, 10, 1024)])
    mask = as_mask(planes)
    result = fc.domains.hausdorff_content(mask, [1.0, 1.5], shifts=3)
    assert result.hausdorff_content.dims == ("step", "exponent")
    for k in range(3):
        alone = fc.domains.hausdorff_content(mask[k], [1.0, 1.5], shifts=3)
        np.testing.assert_array_equal(result.hausdorff_content[k], alone.hausdorff_content)
    chunked = fc.domains.hausdorff_content(mask.chunk({"y": 10}), [1.0, 1.5], shifts=3)
    np.testing.assert_array_equal(chunked.hausdorff_content, result.hausdorff_content)
    valid = as_mask(np.random.default_rng(1).random((32, 32)) < 0.5)
    masked = fc.domains.hausdorff_content(mask, 1.2, valid=valid).hausdorff_content
    np.testing.assert_array_equal(masked, fc.domains.hausdorff_content(mask & valid, 1.2).hausdorff_content)
    assert (result.hausdorff_content[0] == 0).all()
    assert result.hausdorff_content.attrs["comment"] == "in m^s"
    assert fc.domains.hausdorff_content(mask.values, 1.0).hausdorff_content.attrs["comment"] == "in cells^s"


def test_all_wrong_arguments_are_listed():
    mask = as_mask(np.ones((8, 8)), (1e-3, 2e-3))
    with pytest.raises(InvalidInput) as caught:
        fc.domains.hausdorff_content(mask, [1.0, 2.5], coarsest=-1.0, shifts=0)
    for words in ("square cells", "s: expected", "coarsest: expected", "shifts: expected"):
        assert words in str(caught.value)


@pytest.mark.parametrize("keep", [0.6, 0.75])
def test_bracket_of_fractal_percolation(keep):
    """Refinements of one set, D = 2 + log2(keep): the area falls as h^(2 - D), the content at D stays."""
    rng = np.random.default_rng(8)
    masks, cells = [], np.ones((1, 1), bool)
    for level in range(10):
        cells = cells.repeat(2, 0).repeat(2, 1)
        cells &= (rng.random(cells.shape) < keep) | (level < 3)
        if level >= 6:
            masks.append(as_mask(cells, (1 / len(cells),) * 2))
    result = fc.domains.area_dimension(masks)
    truth = 2 + np.log2(keep)
    assert float(result.area_dimension) == pytest.approx(truth, abs=0.04)
    assert float(result.stationary_exponent) == pytest.approx(truth, abs=0.12)
    assert float(result.stationary_exponent) <= float(result.area_dimension) + 0.01


def test_stationary_exponent_of_lattice_sets():
    masks = [as_mask(lattice_set("gasket", level), (2.0**-level,) * 2) for level in (5, 6, 7, 8)]
    result = fc.domains.area_dimension(masks)
    assert float(result.area_dimension) == pytest.approx(DIMENSION["gasket"], abs=1e-9)
    assert float(result.stationary_exponent) == pytest.approx(DIMENSION["gasket"], abs=0.03)
    thirds = [as_mask(lattice_set("carpet", level), (3.0**-level,) * 2) for level in (3, 4)]
    assert np.isnan(fc.domains.area_dimension(thirds).stationary_exponent)


def contact(n, finest, boundary, pressures, keep=("state",), rolloff=None):
    """Press one surface of 1 m, sampled at n of `finest` points, and return the result."""
    surface = fc.surfaces.spectral(
        (finest, finest), 1 / finest, hurst=0.8, rms_slope=0.1, rolloff=0.5, short_cutoff=rolloff, rng=3
    )
    step = finest // n
    sampled = fc.surfaces.from_array(surface.values[::step, ::step], 1 / n, periodic=True)
    return fc.contact.press(
        sampled,
        contact_modulus=1e9,
        nominal_pressure=pressures,
        boundary=boundary,
        tolerance=1e-6,
        keep=keep,
        include="stiffness",
    )


def test_stiffness_of_solved_contacts_is_below_the_content():
    """Capacity is subadditive and a square punch has 1.1523 E* side: k <= 1.1523 E* H^1 (free)."""
    pressed = contact(64, 64, "free", [1e5, 1e6, 1e7])
    bound = 1.1523 * 1e9 * fc.domains.hausdorff_content(pressed.state, 1.0).hausdorff_content
    stiffness = pressed.contact_stiffness * 1.0  # of the extent of 1 m2
    ratio = (stiffness / bound).values
    assert (ratio < 1).all()
    assert (ratio > 0.2).all()


def test_load_and_set_bracket_the_dimension():
    """D2 of the pressure <= D2 of the set <= D0 between a box and the extent; a load raises all of them."""
    pressed = contact(64, 64, "periodic", [1e6, 1e7], ("state", "pressure"), rolloff=0.06)
    brackets = []
    for name, order in (("pressure", 2), ("state", 2), ("state", 0)):
        result = fc.domains.generalised_dimensions(pressed[name], order, box_sizes=[2, 64])
        brackets.append(result.generalised_dimension.values.squeeze())
    assert (np.diff(brackets, axis=0) > 0.02).all()
    assert (np.diff(brackets, axis=1) > 0.1).all()


@pytest.mark.slow
def test_content_of_an_unresolved_surface_does_not_depend_on_the_grid():
    """The area falls by a fifth or more from 64 to 256 cells, the content at s0 does not."""
    states = [contact(n, 256, "periodic", [4e6]).state for n in (64, 128, 256)]
    result = fc.domains.area_dimension(states)
    area = result.contact_fraction.values
    assert area[..., 0] < 0.8 * area[..., -1]
    s = float(result.stationary_exponent.squeeze())
    assert 1.0 <= s <= float(result.area_dimension.squeeze())
    contents = [
        float(fc.domains.hausdorff_content(state, s, shifts=4).hausdorff_content.squeeze())
        for state in states
    ]
    assert max(contents) < 1.08 * min(contents)
