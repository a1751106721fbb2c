"""Many scans as one study: which files, what is stacked, what fails, what a stop or a lost worker loses."""

import functools
import os
import signal
import threading
import time
from urllib.parse import quote

import numpy as np
import pytest
import xarray as xr
from copies import Copy, copied_command

import fractalcontact as fc
from fractalcontact.base.errors import FractalContactError, FractalContactWarning, InvalidInput

SCENE = """title = "Scans"
[surface]
read = "scans/*.nc"
[want]
surfaces = ["height", "describe"]
dimensions = ["increments", "variogram"]
domains = []
"""
GRIDS = {"a.nc": (32, 1e-4), "b.nc": (48, 1e-4), "c.nc": (32, 2e-4), "d.nc": (40, 1e-4), "e.nc": (32, 1e-4)}


def write_scans(folder, grids=GRIDS):
    (folder / "scans").mkdir()
    for seed, (name, (size, spacing)) in enumerate(grids.items()):
        surface = fc.surfaces.fbm((size, size), spacing, hurst=0.7, rms_increment=1e-5, rng=seed)
        fc.save(surface, folder / "scans" / name)
    (folder / "scans.toml").write_text(SCENE, encoding="utf-8")
    return folder / "scans.toml"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Five scans, one of them damaged: its scene, folder and result."""
    folder = tmp_path_factory.mktemp("scans")
    scene = write_scans(folder)
    (folder / "scans" / "damaged.nc").write_bytes(b"no heights")
    with pytest.warns(FractalContactWarning, match="1 of 6 scans failed or are incomplete"):
        result = fc.scenes.run(scene, out=folder / "out", progress=False)
    return scene, folder / "out", result


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    """Four sound scans, studied in this process: their scene, folder and result."""
    folder = tmp_path_factory.mktemp("serial")
    scene = write_scans(folder, {name: GRIDS[name] for name in [*GRIDS][:4]})
    return scene, folder / "out", fc.scenes.run(scene, out=folder / "out", progress=False)


def same(one, other, leave_out=("run_time",)):
    """Assert that two studies have the same bits in all groups, but for the time they took."""
    assert [node.path for node in one.subtree] == [node.path for node in other.subtree]
    for node in one.subtree:
        data, twin = (each[node.path].to_dataset(inherit=False) for each in (one, other))
        xr.testing.assert_equal(
            data.drop_vars(leave_out, errors="ignore"), twin.drop_vars(leave_out, errors="ignore")
        )


def test_each_scan_equals_its_own_study(study):
    _, out, result = study
    for name in GRIDS:
        surface = fc.open(out.parent / "scans" / name)
        alone = fc.dimensions.estimate(surface, ["increments", "variogram"])
        np.testing.assert_array_equal(result["dimensions/hurst"].sel(scan=name), alone["hurst"])
        stored = fc.open(out / "scans" / name / "result.nc")["surfaces/height"]
        np.testing.assert_array_equal(stored, surface)
        assert (out / "scans" / name / "report.html").is_file()


def test_a_damaged_scan_is_a_row_with_its_reason(study):
    _, out, result = study
    overview = result["overview"].to_dataset()
    assert list(overview["scan"].values) == sorted([*GRIDS, "damaged.nc"])
    row = overview.sel(scan="damaged.nc")
    assert str(row["status"].values) == "failed"
    assert "damaged" in str(row["reason"].values)
    assert np.isnan(row["fractal_dimension"])
    assert "damaged.nc" not in result["dimensions"]["scan"]
    assert [int(result[f"{name}_scans"]) for name in ("rms_height", "fractal_dimension")] == [5, 5]
    rows = (out / "scans.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 1 + len(GRIDS) + 1
    page = (out / "report.html").read_text(encoding="utf-8")
    assert 'href="scans/a.nc/report.html"' in page
    assert 'href="scans/damaged.nc' not in page


def test_file_has_the_maps_of_each_scan(study):
    _, out, result = study
    assert all("y" not in node.dims for node in result.subtree)
    whole = fc.open(out / "result.nc")
    alone = fc.open(out / "scans" / "a.nc" / "result.nc")["surfaces/height"]
    assert alone.shape == (32, 32)
    xr.testing.assert_identical(whole["scans/a.nc/surfaces/height"], alone)
    same(whole.filter(lambda node: not node.path.startswith("/scans")), result)


def test_report_of_the_file_has_the_overview_and_links(study):
    """Once an error: the figures of one scan were wanted of all."""
    _, out, _ = study
    page = fc.scenes.report(out / "result.nc", out / "again.html").read_text(encoding="utf-8")
    assert 'href="scans/a.nc/report.html"' in page
    assert "data:image/png" in page


def test_result_of_one_scan_is_reproduced_and_that_of_all_refused(study):
    scene, out, result = study
    of_one = fc.open(out / "scans" / "b.nc" / "result.nc")["dimensions"]
    again = fc.scenes.reproduce(of_one, folder=scene.parent / "scans")
    np.testing.assert_array_equal(again["hurst"], of_one["hurst"])
    with pytest.raises(InvalidInput, match="result: expected that of one scan, .* got that of 5 scans"):
        fc.scenes.reproduce(result["dimensions"], folder=scene.parent / "scans")


def test_stage_that_fails_leaves_the_other_results_of_its_scan(tmp_path):
    scene = write_scans(tmp_path, {"a.nc": (32, 1e-4), "gap.nc": (32, 1e-4)})
    file = tmp_path / "scans" / "gap.nc"
    surface = fc.open(file)
    surface[4:9, 3:12] = np.nan
    fc.save(surface, file)
    text = SCENE.replace("domains = []", 'contact = ["press"]\ndomains = ["box_dimension"]')
    scene.write_text(f"{text}[contact]\ncontact_modulus = 1e10\nnominal_pressure = 1e6\n", encoding="utf-8")
    out = tmp_path / "out"
    with pytest.warns(FractalContactWarning, match="1 of 2 scans"):
        result = fc.scenes.run(scene, out=out, progress=False)
    row = result["overview"].to_dataset().sel(scan="gap.nc")
    assert str(row["status"].values) == "incomplete"
    assert str(row["reason"].values).startswith("contact, domains/box_dimension: surface: ")
    alone = fc.dimensions.estimate(surface, ["increments", "variogram"])
    np.testing.assert_array_equal(result["dimensions/hurst"].sel(scan="gap.nc"), alone["hurst"])
    assert list(result["contact"]["scan"].values) == ["a.nc"]
    assert [int(result[f"{name}_scans"]) for name in ("fractal_dimension", "contact_fraction")] == [2, 1]
    page = (out / "scans" / "gap.nc" / "report.html").read_text(encoding="utf-8")
    assert "partial: contact, domains/box_dimension: surface: " in page
    part = next((out / "scans" / "gap.nc" / ".stages").glob("dimensions.*"))
    kept = part.stat().st_mtime_ns
    with pytest.warns(FractalContactWarning, match="1 of 2 scans"):
        fc.scenes.run(scene, out=out, progress=False)
    assert part.stat().st_mtime_ns == kept
    fc.save(surface.fillna(0.0).assign_attrs(surface.attrs), file)
    mended = fc.scenes.run(scene, out=out, progress=False)
    assert (mended["overview/status"] == "done").all()


def test_stage_that_reads_a_failing_map_names_itself(tmp_path, monkeypatch):
    scene = write_scans(tmp_path, {"a.nc": (32, 1e-4)})
    text = SCENE.replace("domains = []", 'contact = ["press"]\ndomains = ["box_dimension", "lacunarity"]')
    text = text.replace('"scans/*.nc"', '["scans/a.nc"]')
    scene.write_text(f"{text}[contact]\ncontact_modulus = 1e10\nnominal_pressure = 1e6\n", encoding="utf-8")

    @functools.wraps(fc.domains.box_dimension)
    def fail(*_, **__):
        raise ArithmeticError("no boxes")

    monkeypatch.setattr(fc.domains, "box_dimension", fail)
    with pytest.warns(FractalContactWarning, match="1 of 1 scans"):
        result = fc.scenes.run(scene, progress=False)
    assert str(result["overview/reason"].values[0]) == "domains/box_dimension: ArithmeticError: no boxes"
    assert {"/contact", "/domains/lacunarity"} <= set(result.groups)
    assert "/domains/box_dimension" not in result.groups


def test_scans_whose_names_differ_by_a_slash_have_their_own_folders(tmp_path):
    scene = write_scans(tmp_path, {"d_a.nc": (32, 1e-4), "a.nc": (48, 1e-4)})
    (tmp_path / "scans" / "d").mkdir()
    (tmp_path / "scans" / "a.nc").rename(tmp_path / "scans" / "d" / "a.nc")
    scene.write_text(SCENE.replace("*.nc", "**/*.nc"), encoding="utf-8")
    result = fc.scenes.run(scene, out=tmp_path / "out", progress=False)
    assert list(result["overview/scan"].values) == ["d/a.nc", "d_a.nc"]
    pages = sorted((tmp_path / "out" / "scans").glob("*/report.html"))
    assert len(pages) == 2
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for page in pages:
        assert f'href="scans/{quote(page.parent.name)}/report.html"' in text


def test_scans_have_any_names_that_files_have(tmp_path):
    accents = ["\N{LATIN SMALL LETTER U WITH DIAERESIS}.nc", "u\N{COMBINING DIAERESIS}.nc"]
    names = ["%25.nc", "-1.nc", "(a) #1?.nc", "_%25.nc", "_-1.nc", "a\n.nc", *accents]
    scene = write_scans(tmp_path, dict.fromkeys(names, (16, 1e-4)))
    scene.write_text(SCENE.partition("dimensions")[0], encoding="utf-8")
    result = fc.scenes.run(scene, out=tmp_path / "out", progress=False)
    assert set(result["overview/scan"].values) == set(names)
    groups = fc.open(tmp_path / "out" / "result.nc")["scans"].children
    assert set(groups) == {path.name for path in (tmp_path / "out" / "scans").iterdir()}
    heights = {groups[group]["surfaces/height"].values.tobytes() for group in groups}
    assert len(heights) == len(groups) == len(names)


def test_a_file_named_twice_is_refused(tmp_path):
    scene = write_scans(tmp_path, {"a.nc": (32, 1e-4)})
    scene.write_text(SCENE.replace('"scans/*.nc"', '["scans/a.nc", "./scans/a.nc"]'), encoding="utf-8")
    with pytest.raises(InvalidInput, match=r"each file once, got a\.nc again"):
        fc.scenes.validate(scene)


def test_mean_has_the_interval_of_student_without_errors(study):
    result = study[2]
    heights = result["overview/rms_height"].values
    heights = heights[np.isfinite(heights)]
    half = 2.776445105197793 * heights.std(ddof=1) / np.sqrt(5)  # t of 4 degrees of freedom
    mean, low, high = (float(result[f"rms_height{end}"]) for end in ("", "_low", "_high"))
    expected = np.maximum(heights.mean() + half * np.array([0, -1, 1]), 0.0)  # no mean height is negative
    np.testing.assert_allclose([mean, low, high], expected, rtol=1e-9)


def mean_over(tmp_path, surfaces, name, scene):
    """Return a column of the table of scans, its mean over them, and the ends of the interval of the mean."""
    (tmp_path / "scans").mkdir()
    for number, surface in enumerate(surfaces):
        fc.save(surface, tmp_path / "scans" / f"{number}.nc")
    (tmp_path / "scans.toml").write_text(f'surface.read = "scans/*.nc"\n{scene}', encoding="utf-8")
    result = fc.scenes.run(tmp_path / "scans.toml", progress=False)
    mean, low, high = (float(result[f"{name}{end}"]) for end in ("", "_low", "_high"))
    return result["overview"].to_dataset(), mean, low, high


def test_interval_of_a_share_of_the_area_ends_at_none_and_at_all_of_it(tmp_path):
    surfaces = [
        fc.surfaces.spectral((32, 32), 1e-4, hurst=0.8, rms_slope=slope, rng=1)
        for slope in (0.08, 0.012, 0.01)
    ]
    scene = '[contact]\ncontact_modulus = 1e9\nnominal_pressure = 1e7\n[want]\ncontact = ["press"]\n'
    overview, mean, low, high = mean_over(tmp_path, surfaces, "contact_fraction", scene)
    shares = overview["contact_fraction"].values
    half = 4.30265 * shares.std(ddof=1) / 3**0.5  # Student, 2 degrees of freedom
    assert mean == pytest.approx(shares.mean())
    assert mean - half < 0.0
    assert mean + half > 1.0
    assert (low, high) == (0.0, 1.0)


def test_interval_of_the_dimension_of_white_noise_ends_at_three(tmp_path):
    surfaces = [
        fc.surfaces.from_array(1e-6 * np.random.default_rng(seed).standard_normal((32, 32)), 1e-4)
        for seed in range(3)
    ]
    scene = '[want]\ndimensions = ["increments"]\n'
    overview, mean, low, high = mean_over(tmp_path, surfaces, "fractal_dimension", scene)
    error = (overview["standard_error"] ** -2.0).sum().item() ** -0.5  # the scans differ by no more
    half = 4.30265 * error  # Student, 2 degrees of freedom
    assert mean + half > 3.0
    assert high == 3.0
    assert low == pytest.approx(mean - half, abs=1e-5)


def test_finished_scans_are_not_repeated_and_a_mended_one_is_studied(study):
    scene, out, result = study
    surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.7, rms_increment=1e-5, rng=9)
    damaged, content = scene.parent / "scans" / "damaged.nc", b"no heights"
    times = {name: (out / "scans" / name / "result.nc").stat().st_mtime_ns for name in GRIDS}
    fc.save(surface, damaged)
    mended = fc.scenes.run(scene, out=out, progress=False)
    damaged.write_bytes(content)
    assert {name: (out / "scans" / name / "result.nc").stat().st_mtime_ns for name in GRIDS} == times
    assert (mended["overview/status"] == "done").all()
    np.testing.assert_array_equal(
        mended["dimensions/hurst"].drop_sel(scan="damaged.nc"), result["dimensions/hurst"]
    )


def test_finished_scans_are_repeated_where_what_their_caveats_stand_on_has_changed(tmp_path):
    scene = write_scans(tmp_path, {"a.nc": (32, 1e-4)})
    pressed = SCENE.replace("domains = []", 'contact = ["press"]').replace('dimensions = ["incr', '# ["incr')
    pressed += "[contact]\nnominal_pressure = 1e6\n[material]\nyoung = 6e10\npoisson = 0.2\n"
    caveats = []
    for limit in (1e12, 1e6):
        scene.write_text(f"{pressed}yield_pressure = {limit}\n", encoding="utf-8")
        result = fc.scenes.run(scene, out=tmp_path / "out", progress=False)
        caveats.append(str(result["overview/caveats"].item()))
    assert ["the material yields at" in text for text in caveats] == [False, True]


def test_workers_change_no_bit(serial, tmp_path):
    scene, out, result = serial
    same(fc.scenes.run(scene, out=tmp_path, progress=False, workers=2), result)
    same(*(fc.open(folder / "result.nc") for folder in (tmp_path, out)))
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in out.iterdir()}


def test_without_a_folder_the_result_has_maps_and_curves_have_their_own_scales(tmp_path):
    scene = write_scans(tmp_path, {"a.nc": (32, 1e-4), "b.nc": (48, 2e-4)})
    scene.write_text(f"{SCENE}figures = true\n", encoding="utf-8")
    result = fc.scenes.run(scene, progress=False)
    assert result["scans/b.nc/surfaces/height"].shape == (48, 48)
    curves = result["dimensions/variogram"].to_dataset()
    for name, size in (("a.nc", 32), ("b.nc", 48)):
        surface = result[f"scans/{name}/surfaces/height"]
        alone = fc.dimensions.variogram(surface)
        count = alone.sizes["lag"]
        assert count < size
        for key in ("lag", "variogram"):
            values = curves[key].sel(scan=name)
            np.testing.assert_array_equal(values[:count], alone[key])
            assert np.isnan(values[count:]).all()


def test_scans_of_several_folders_keep_their_paths_as_names(tmp_path):
    scene = write_scans(tmp_path, {"a.nc": (32, 1e-4)})
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "a.nc").write_bytes((tmp_path / "scans" / "a.nc").read_bytes())
    text = SCENE.replace('"scans/*.nc"', '["scans/a.nc", "more/a.nc"]')
    scene.write_text(text, encoding="utf-8")
    result = fc.scenes.run(scene, out=tmp_path / "out", progress=False)
    assert list(result["overview/scan"].values) == ["scans/a.nc", "more/a.nc"]
    assert list(result["overview/status"].values) == ["done", "done"]


def test_study_of_damaged_scans_alone_is_refused(tmp_path):
    scene = write_scans(tmp_path, {"a.nc": (32, 1e-4), "b.nc": (32, 1e-4)})
    for name in ("a.nc", "b.nc"):
        (tmp_path / "scans" / name).write_bytes(b"no heights")
    scene.write_text(SCENE + "figures = true\n", encoding="utf-8")
    with pytest.raises(InvalidInput, match=r"a\.nc.*damaged"):
        fc.scenes.run(scene, out=tmp_path / "out", progress=False)
    assert not (tmp_path / "out").exists()


def test_pairs_are_matched_by_name_and_mismatches_listed(tmp_path):
    write_scans(tmp_path, {f"{n}_{face}.nc": (32, 1e-4) for n in (1, 2) for face in "ab"})
    for n in (1, 2):
        lower = fc.open(tmp_path / "scans" / f"{n}_a.nc")
        fc.save((lower + 1e-4).rename("height").assign_attrs(lower.attrs), tmp_path / "scans" / f"{n}_b.nc")
    pair = '[joint]\nlower = "scans/*_a.nc"\nupper = "scans/*_b.nc"\nblock = 1e-3\nshear = [0.0, 1e-4]\n'
    scene = tmp_path / "pairs.toml"
    scene.write_text(pair + '[want]\njoints = ["rigid_dilatancy"]\n', encoding="utf-8")
    result = fc.scenes.run(scene, progress=False)
    assert list(result["overview/scan"].values) == ["1", "2"]
    (tmp_path / "scans" / "2_b.nc").rename(tmp_path / "scans" / "3_b.nc")
    with pytest.raises(InvalidInput, match="2_a.nc has no upper face; scans/3_b.nc has no lower face"):
        fc.scenes.validate(scene)


def test_upper_faces_need_lower_ones(tmp_path):
    scene = write_scans(tmp_path)
    made = 'generate = "fbm"\nshape = [32, 32]\nspacing = 1e-4\nhurst = 0.7\nrms_increment = 1e-5'
    scene.write_text(SCENE.replace('read = "scans/*.nc"', made) + '[upper]\nread = "scans/*.nc"\n')
    with pytest.raises(InvalidInput, match=r"surface.read: expected a lower face for every upper one"):
        fc.scenes.validate(scene)


def test_a_scene_that_fits_no_scan_is_refused(tmp_path):
    write_scans(tmp_path, {"a.nc": (32, 1e-4), "b.nc": (32, 1e-4)})
    scene = tmp_path / "joint.toml"
    text = (
        SCENE.replace("domains = []", 'joints = ["rigid_dilatancy"]') + "[joint]\nblock = 1.0\nshear = 0.0\n"
    )
    scene.write_text(text, encoding="utf-8")
    with pytest.raises(InvalidInput, match="block"):
        fc.scenes.run(scene, out=tmp_path / "out", progress=False)
    assert not (tmp_path / "out").exists()


def test_command_prints_a_row_for_each_scan_and_tells_failures_by_its_exit(tmp_path):
    names = [*GRIDS][:3]
    write_scans(tmp_path, {name: GRIDS[name] for name in names})
    files = [tmp_path / "scans" / name for name in (*names, "bad.nc")]
    files[-1].write_bytes(b"")
    done = copied_command("roughness", *files[1:], "-o", tmp_path / "out")
    assert done.returncode == 1, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) <= 40
    assert sum(line.startswith(tuple(names[1:])) for line in lines) == 2
    assert any(line.startswith("dimension D") for line in lines)
    refused = copied_command("joint", *files, "--young", "30GPa", "-o", tmp_path / "joint")
    assert refused.returncode == 2
    assert "differ by the face alone" in refused.stderr
    alone = copied_command("joint", files[0], "--young", "30GPa", "-o", tmp_path / "joint")
    assert "expected as many files of lower as of upper faces, got 1 in all" in alone.stderr


def test_jrc_below_its_scale_is_in_words_and_in_no_mean(tmp_path):
    (tmp_path / "scans").mkdir()
    for seed, rms in enumerate((1e-6, 6e-5, 8e-5)):
        surface = fc.surfaces.fbm((48, 48), 2e-4, hurst=0.8, rms_increment=rms, rng=seed)
        fc.save(surface, tmp_path / "scans" / f"{seed}.nc")
    scene = tmp_path / "scans.toml"
    scene.write_text(
        'surface.read = "scans/*.nc"\n[want]\njoints = ["roughness_coefficient"]\n', encoding="utf-8"
    )
    result = fc.scenes.run(scene, progress=False)
    jrc = result["overview/roughness_coefficient"].values
    assert jrc[0] < 0 < min(jrc[1:])
    assert float(result["roughness_coefficient"]) == pytest.approx(np.mean(jrc[1:]))
    assert int(result["roughness_coefficient_scans"]) == 2
    text = fc.scenes.summary(result)
    assert "left out of the mean: 0.nc" in text
    assert "below 0" in next(line for line in text.splitlines() if line.startswith("0.nc"))


def test_jrc_below_its_scale_is_no_outlier_of_those_on_it(study):
    overview = study[2]["overview"].to_dataset().isel(scan=[0, 0, 0, 0, 0, 0])
    jrc = xr.Variable("scan", [-40.0, 3.0, 3.1, 3.2, 2.9, 9.0], {"units": "1"})
    overview = overview.assign(roughness_coefficient=jrc, scan=list("abcdef"))
    lines = fc.scenes.summary(xr.DataTree.from_dict({"overview": overview})).splitlines()
    assert "JRC is below 0, beyond its scale, and left out of the mean: a" in lines
    assert "outliers: JRC of f" in lines


def test_many_rows_are_cut_with_a_word(study):
    overview = study[2]["overview"].to_dataset().isel(scan=[0, 1, 2, 3, 4] * 20)
    overview["scan"] = [f"scan {n:03d}" for n in range(100)]
    tree = xr.DataTree.from_dict({"/": study[2].to_dataset(), "/overview": overview})
    text = fc.scenes.summary(tree)
    assert len(text.splitlines()) <= 36
    assert "of 100)" in text


@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.slow), signal.SIGKILL])
def test_stopped_study_resumes_from_its_finished_scans(serial, tmp_path, number):
    scene, out = serial[0], tmp_path / "out"
    process = Copy("run", scene, "-o", out, "--workers", 2, "--quiet")
    while not list(out.glob("scans/*/report.html")) and process.poll() is None:
        time.sleep(0.005)
    os.kill(process.pid, number)
    _, message = process.communicate()
    assert process.returncode == (-number if number == signal.SIGKILL else 128 + number), message
    finished = {path: path.stat().st_mtime_ns for path in out.glob("scans/*/report.html")}
    assert finished
    same(fc.scenes.run(scene, out=out, progress=False), serial[2])
    assert {path: path.stat().st_mtime_ns for path in finished} == finished


@pytest.mark.slow
@pytest.mark.parametrize("lost", ["worker", "scheduler"])
def test_lost_process_of_dask_loses_no_finished_scan(serial, tmp_path, lost):
    distributed = pytest.importorskip("distributed")
    scene, out = serial[0], tmp_path / "out"
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)

    def end_one():
        while not list(out.glob("scans/*/report.html")):
            time.sleep(0.005)
        if lost == "worker":
            os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)
        else:
            cluster.close()

    with cluster, distributed.Client(cluster) as client:
        killer = threading.Thread(target=end_one, daemon=True)
        killer.start()
        if lost == "worker":
            result = fc.scenes.run(scene, out=out, progress=False, client=client)
        else:
            with pytest.raises(FractalContactError, match="the same run resumes"):
                fc.scenes.run(scene, out=out, progress=False, client=client)
        killer.join(30)
    finished = {path: path.stat().st_mtime_ns for path in out.glob("scans/*/report.html")}
    if lost == "scheduler":
        result = fc.scenes.run(scene, out=out, progress=False)
        assert finished
        assert {path: path.stat().st_mtime_ns for path in finished} == finished
    same(result, serial[2])
