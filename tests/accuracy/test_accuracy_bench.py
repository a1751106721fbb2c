"""The bench of the estimators: its bounds against closed forms and tables, its counts by hand."""

import json

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.accuracy import _bounds, bench
from fractalcontact.accuracy.reporting import estimators_table
from fractalcontact.base.errors import InvalidInput
from fractalcontact.cli import main


@pytest.fixture(scope="module")
def small():
    return fc.accuracy.estimators(
        hurst=(0.3, 0.7), sizes=32, methods=("likelihood", "variogram"), members=60, rng=5
    )


def test_bound_of_brownian_faces_is_the_known_one():
    known = {0.05: 0.356, 0.1: 0.512, 0.3: 0.856, 0.5: 1.029, 0.7: 1.130, 0.9: 1.194}
    for hurst, value in known.items():
        assert _bounds.fractional_brownian(hurst, 100) * 100 == pytest.approx(value, rel=5e-3)


def test_aliased_density_is_the_sum_over_many_more_images():
    hurst = 0.4
    w = (np.arange(_bounds._POINTS) + 0.5) / _bounds._POINTS * np.pi
    j = np.arange(-400, 401)
    corner = (
        np.sum(((w[-1] + 2 * np.pi * j[:, None]) ** 2 + (w[-1] + 2 * np.pi * j) ** 2) ** (-1 - hurst))
        + 2 * np.pi * (801 * np.pi) ** (-2 * hurst) / (2 * hurst) / (2 * np.pi) ** 2
    )
    assert _bounds._aliased(hurst)[-1, -1] == pytest.approx(corner, rel=2e-3)


def test_bound_of_a_square_band_is_the_known_one():
    """All modes of a periodic grid: n times the bound tends to 1.383."""
    n = 512
    assert _bounds.band_limited((n, n), 0.0, np.inf) * n == pytest.approx(1.383, rel=0.01)


def test_bound_of_a_band_is_reached_by_regression_on_its_modes():
    n, hurst = 32, 0.5
    rng = np.random.default_rng(3)
    q = np.hypot(*np.meshgrid(np.fft.fftfreq(n), np.fft.fftfreq(n), indexing="ij"))
    half = np.zeros((n, n), bool)
    half[1 : n // 2] = True
    half[0, 1 : n // 2] = True
    kept = half & (q >= 1 / n * (1 - 1e-9)) & (q <= 0.25 * (1 + 1e-9))
    logs = np.log(q[kept])
    found = []
    for _ in range(800):
        power = q[kept] ** (-2 - 2 * hurst) * rng.standard_exponential(kept.sum())
        guess = hurst
        for _ in range(8):  # scoring: each independent mode is two real numbers
            scaled = power * q[kept] ** (2 + 2 * guess)
            centred = logs - logs.mean()
            guess -= 0.5 * np.sum(centred * (scaled / scaled.mean() - 1)) / np.sum(centred**2)
        found.append(guess)
    assert np.std(found) == pytest.approx(_bounds.band_limited((n, n), 4.0, float(n)), rel=0.08)


def test_judgement_of_a_case_by_hand():
    values, low, high = np.array([0.5, 0.6, 0.4, np.nan]), np.array([0.4, 0.55, 0.3, np.nan]), None
    high = np.array([0.6, 0.65, 0.5, np.nan])
    judged = bench._judged(0.5, 0.01, values, low, high, np.array([1.0, 2.0, 3.0, 9.0]))
    assert judged["bias"] == pytest.approx(0.0)
    assert judged["rms_error"] == pytest.approx(np.sqrt(0.02 / 3))
    assert judged["error_ratio"] == pytest.approx(100 * np.sqrt(0.02 / 3))
    assert judged["interval_coverage"] == pytest.approx(2 / 3)
    assert judged["interval_coverage_low"] < 2 / 3 < judged["interval_coverage_high"]
    assert judged["interval_share"] == 0.75
    assert judged["run_time"] == 2.5


def test_the_default_is_near_the_bound_on_both_families(small):
    default = small.sel({"method": "likelihood"})
    assert default["error_ratio"].dims == ("family", "hurst", "size")
    assert (default["error_ratio_low"] < 1.15).all()
    assert (default["interval_coverage_high"] > 0.93).all()
    assert (default["interval_share"] == 1).all()
    assert (default["run_time"] > 0).all()


def test_a_method_without_intervals_says_so(small):
    line = small.sel({"method": "variogram"})
    assert np.isnan(line["interval_coverage"]).all()
    assert (line["interval_share"] == 0).all()
    assert "no interval" in line["interval_coverage"].attrs["reason"]
    # the wrong family for the variogram: its shortest lags know nothing of H
    assert (line.sel(family="spectral", hurst=0.3)["bias"] > 0.3).all()


def test_the_figure_shows_what_was_measured(small):
    axes = fc.plotting.estimator_errors(small).axes
    assert [ax.get_title(loc="left") for ax in axes[:2]] == ["fbm, n = 32", "spectral, n = 32"]
    shown = [np.asarray(line.get_ydata()) for line in axes[1].lines]
    for method in small["method"].values:
        one = small.sel({"method": method, "family": "spectral", "size": 32})
        assert any(np.array_equal(y, one["error_ratio"].values) for y in shown)
    with pytest.raises(InvalidInput, match="error_ratio"):
        fc.plotting.estimator_errors(small.drop_vars("error_ratio"))


def test_the_same_stream_gives_the_same_numbers(small):
    again = fc.accuracy.estimators(
        hurst=(0.3, 0.7), sizes=32, methods=("likelihood", "variogram"), members=60, rng=5
    )
    assert again.drop_vars("run_time").equals(small.drop_vars("run_time"))


def test_table_and_command(capsys, tmp_path, small):
    text = estimators_table(small)
    assert "fbm, 32 x 32 points, 60 surfaces" in text
    assert "none" in text
    asked = (
        "accuracy estimators --hurst .5 --sizes 16 --families fbm --methods increments --members 3 --seed 1"
    )
    assert main([*asked.split(), "-o", str(tmp_path)]) == 0
    assert "increments" in capsys.readouterr().out
    assert (tmp_path / "estimators.png").stat().st_size > 0
    back = fc.open(tmp_path / "estimators.nc")
    assert back["error_ratio"].shape == (1, 1, 1, 1)


def test_wrong_input_is_named():
    with pytest.raises(InvalidInput) as caught:
        fc.accuracy.estimators(hurst=1.5, sizes=8, families="cantor", methods="magic", members=[1, 2])
    for word in ("hurst", "sizes", "cantor", "magic", "members"):
        assert word in str(caught.value)


CASES = {"hurst": (0.3, 0.7), "sizes": (16, 20), "families": "fbm", "methods": "increments", "members": 4}


def test_a_stopped_bench_goes_on_where_it_was(tmp_path, monkeypatch):
    """The third case is stopped; the same call does the last two and gives the numbers of a whole run."""
    file, sampled, sample = tmp_path / "bench.nc", [], bench._sample

    def stopping(family, hurst, n, *rest):
        if len(sampled) == 2:
            raise KeyboardInterrupt
        sampled.append((hurst, n))
        return sample(family, hurst, n, *rest)

    monkeypatch.setattr(bench, "_sample", stopping)
    with pytest.raises(KeyboardInterrupt):
        fc.accuracy.estimators(**CASES, keep=file)
    part = fc.open(file)
    assert np.isfinite(part["least_error"]).sum() == 2
    assert "stopped" in part["rms_error"].attrs["reason"]
    monkeypatch.setattr(bench, "_sample", lambda *given: sampled.append(given[1:3]) or sample(*given))
    whole = fc.accuracy.estimators(**CASES, keep=file)
    assert sampled == [(0.3, 16), (0.7, 16), (0.3, 20), (0.7, 20)]
    assert fc.open(file).drop_vars("run_time").equals(whole.drop_vars("run_time"))
    begun = json.loads(whole.attrs["provenance"])["random"]
    again = fc.accuracy.estimators(**CASES, rng=begun)
    assert again.drop_vars("run_time").equals(whole.drop_vars("run_time"))


def test_a_file_of_other_cases_or_of_another_stream_is_not_gone_on_with(tmp_path):
    file = tmp_path / "bench.nc"
    made = fc.accuracy.estimators(**CASES, rng=1, keep=file)
    made["least_error"][0, 0, 0] = np.nan
    made["bias"][:] = 99.0
    for asked in ({"rng": 2}, {"members": 5}, {"hurst": (0.3, 0.6)}):
        fc.save(made, file)
        assert float(abs(fc.accuracy.estimators(**CASES | asked, keep=file)["bias"]).max()) < 1.0
    file.write_text("no table")
    assert np.isfinite(fc.accuracy.estimators(**CASES, keep=file)["bias"]).all()
    with pytest.raises(InvalidInput, match=r"keep: expected a file name that ends in '\.nc'"):
        fc.accuracy.estimators(**CASES, keep=tmp_path / "bench.txt")
