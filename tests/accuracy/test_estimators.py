"""The benchmark of the estimators: numbers by hand, figure, command, and continuing after a stop."""

import json

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.cli import main

SMALL = {"hurst": (0.3, 0.7), "sizes": 32, "methods": ("likelihood", "variogram"), "rng": 5}


@pytest.fixture(scope="module", params=[6, pytest.param(60, marks=pytest.mark.slow)])
def small(request):
    return fc.accuracy.estimators(**SMALL | {"members": request.param})


def test_numbers_of_one_case_match_a_calculation_by_hand(monkeypatch):
    columns = {
        "hurst": [0.5, 0.6, 0.4, np.nan],
        "ci_low": [0.4, 0.55, 0.3, np.nan],
        "ci_high": [0.6, 0.65, 0.5, np.nan],
        "run_time": [1.0, 2.0, 3.0, 9.0],
    }
    estimates = xr.Dataset({key: (("member", "method"), np.c_[values]) for key, values in columns.items()})
    monkeypatch.setattr(fc.dimensions, "estimate", lambda *_: estimates)
    table = fc.accuracy.estimators(0.5, 32, "fbm", "variogram", members=4).squeeze()
    bound = table["least_error"].item()
    assert table["bias"].item() == pytest.approx(0.0)
    assert table["rms_error"].item() == pytest.approx(np.sqrt(0.02 / 3))
    assert table["error_ratio"].item() == pytest.approx(np.sqrt(0.02 / 3) / bound)
    assert table["interval_coverage"].item() == pytest.approx(2 / 3)
    assert table["interval_coverage_low"].item() < 2 / 3 < table["interval_coverage_high"].item()
    assert table["interval_share"].item() == 0.75
    assert table["run_time"].item() == 2.5


def test_default_estimator_is_near_the_bound_on_both_families(small):
    default = small.sel({"method": "likelihood"})
    assert default["error_ratio"].dims == ("family", "hurst", "size")
    # 32 points along an edge do not tell blur and noise from an exponent: the estimate allows for them
    assert (default["error_ratio_low"] < 3.0).all()
    brownian = default.sel(family="fbm")
    assert (brownian["interval_coverage_high"] > 0.93).all()
    assert (brownian["interval_share"] == 1).all()
    assert (default["run_time"] > 0).all()


def test_method_without_intervals_states_the_reason(small):
    variogram = small.sel({"method": "variogram"})
    assert np.isnan(variogram["interval_coverage"]).all()
    assert (variogram["interval_share"] == 0).all()
    assert "no interval" in variogram["interval_coverage"].attrs["reason"]
    # the wrong family for the variogram: its shortest lags carry no information on H
    assert (variogram.sel(family="spectral", hurst=0.3)["bias"] > 0.3).all()


def test_figure_shows_the_measured_ratios(small):
    axes = fc.plotting.plot(small, "estimator_errors")
    assert [ax.get_title() for ax in axes[0]] == ["fbm, n = 32", "spectral, n = 32"]
    shown = [np.asarray(line.get_ydata()) for line in axes[0, 1].lines]
    for method in small["method"].values:
        column = small.sel({"method": method, "family": "spectral", "size": 32})
        assert any(np.array_equal(y, column["error_ratio"].values) for y in shown)
    with pytest.raises(InvalidInput, match="error_ratio"):
        fc.plotting.plot(small.drop_vars("error_ratio"), "estimator_errors")


def test_same_stream_gives_the_same_numbers():
    once, again, other = (
        fc.accuracy.estimators(0.3, 16, methods="variogram", members=2, rng=stream).drop_vars("run_time")
        for stream in (5, 5, 6)
    )
    assert again.equals(once)
    assert not other.equals(once)


def test_summary_and_command(capsys, tmp_path, small):
    text = fc.accuracy.summary(small)
    assert any(f"fbm, 32 x 32 points, {members} surfaces" in text for members in (6, 60))
    assert "none" in text
    words = (
        "accuracy estimators --hurst .5 --sizes 16 --families fbm --methods increments --members 3 --seed 1"
    )
    assert main([*words.split(), "-o", str(tmp_path)]) == 0
    assert "increments" in capsys.readouterr().out
    assert (tmp_path / "estimators.png").stat().st_size > 0
    assert fc.open(tmp_path / "estimators.nc")["error_ratio"].shape == (1, 1, 1, 1)


def test_summary_of_profiles():
    bench = fc.accuracy.estimators(0.5, 32, ["fbm", "profile"], "increments", members=3, rng=1)
    text = fc.accuracy.summary(bench)
    assert "profile, 32 points, 3 profiles" in text
    assert "fbm, 32 x 32 points, 3 surfaces" in text


def test_wrong_arguments_are_all_named():
    with pytest.raises(InvalidInput) as caught:
        fc.accuracy.estimators(hurst=1.5, sizes=8, families="cantor", methods="magic", members=[1, 2])
    for word in ("hurst", "sizes", "cantor", "magic", "members"):
        assert word in str(caught.value)


@pytest.mark.parametrize("members", [5, pytest.param(12, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("family", "n"), [("crop", 48), ("profile", 256)])
def test_blurred_and_noisy_members_of_a_family(family, n, members):
    """Blur of a whole spacing is in the model: the interval is that of the longer waves."""
    options = {"methods": "likelihood", "members": members, "relative_noise": 0.02, "rng": 3}
    sharp, wide = (fc.accuracy.estimators(0.5, n, family, blur=b, **options).squeeze() for b in (0.0, 1.0))
    assert wide["least_error"] > 1.5 * sharp["least_error"]
    assert abs(sharp["bias"]) < 0.1
    assert abs(wide["bias"]) < 0.2
    assert min(sharp["interval_coverage"], wide["interval_coverage"]) > 0.7


@pytest.mark.parametrize("members", [4, pytest.param(16, marks=pytest.mark.slow)])
def test_slow_rolloff_is_fitted_near_its_bound(members):
    """With an unknown corner the least error is more than twice that of fractional Brownian heights."""
    table = fc.accuracy.estimators(0.5, 96, "matern", "likelihood", members=members, rng=4).squeeze()
    assert table["interval_coverage"].item() > 0.7
    assert 0.4 < table["error_ratio"].item() < 3.0
    assert (
        table["least_error"].item()
        > 2.0 * fc.accuracy.estimators(0.5, 96, "fbm", "increments", members=2, rng=3)["least_error"].item()
    )


def test_marks_of_a_profile_are_removed():
    table = fc.accuracy.estimators(0.5, 512, "profile", "likelihood", members=3, marks=3.0, rng=3).squeeze()
    assert abs(table["bias"].item()) < 0.15


CASES = {"hurst": (0.3, 0.7), "sizes": (16, 20), "families": "fbm", "methods": "increments", "members": 2}


def test_stopped_run_continues_where_it_was(tmp_path, monkeypatch):
    """The third case is stopped; the same call does the last two and gives the numbers of a whole run."""
    file, estimated, estimate = tmp_path / "bench.nc", [], fc.dimensions.estimate

    def stopping(surfaces, *arguments):
        if len(estimated) == 2:
            raise KeyboardInterrupt
        estimated.append(surfaces.sizes["x"])
        return estimate(surfaces, *arguments)

    def counting(surfaces, *arguments):
        estimated.append(surfaces.sizes["x"])
        return estimate(surfaces, *arguments)

    monkeypatch.setattr(fc.dimensions, "estimate", stopping)
    with pytest.raises(KeyboardInterrupt):
        fc.accuracy.estimators(**CASES, file=file)
    part = fc.open(file)
    assert np.isfinite(part["least_error"]).sum() == 2
    assert "stopped" in part["rms_error"].attrs["reason"]
    monkeypatch.setattr(fc.dimensions, "estimate", counting)
    finished = fc.accuracy.estimators(**CASES, file=file)
    assert estimated == [16, 16, 20, 20]
    assert fc.open(file).drop_vars("run_time").equals(finished.drop_vars("run_time"))
    stream = json.loads(finished.attrs["provenance"])["random"]
    again = fc.accuracy.estimators(**CASES, rng=stream)
    assert again.drop_vars("run_time").equals(finished.drop_vars("run_time"))


def test_file_of_another_call_is_not_continued(tmp_path):
    file, cases = tmp_path / "bench.nc", CASES | {"sizes": 16}
    table = fc.accuracy.estimators(**cases, rng=1, file=file)
    table["least_error"][0, 0, 0] = np.nan
    table["bias"][:] = 99.0
    for other in ({"rng": 2}, {"members": 5}, {"hurst": (0.3, 0.6)}):
        fc.save(table, file)
        assert float(abs(fc.accuracy.estimators(**cases | other, file=file)["bias"]).max()) < 1.0
    file.write_text("no table")
    assert np.isfinite(fc.accuracy.estimators(**cases, file=file)["bias"]).all()
    with pytest.raises(InvalidInput, match=r"file: expected a file name that ends in '\.nc'"):
        fc.accuracy.estimators(**cases, file=tmp_path / "bench.txt")


def test_members_follow_the_sizes_as_they_are_given():
    table = fc.accuracy.estimators(0.5, (32, 16), "fbm", "increments", members=(2, 3), rng=1)
    assert table["size"].values.tolist() == [16, 32]
    assert table["member_count"].values.tolist() == [3, 2]
