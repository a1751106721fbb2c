"""A result file holds the wanted results and nothing else."""

import xarray as xr
from study import SOUND

import fractalcontact as fc


def scene(tmp_path, text):
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    return tmp_path / "study.toml"


def test_file_has_the_wanted_results_and_no_map(tmp_path):
    tree = fc.scenes.run(scene(tmp_path, SOUND), out=tmp_path / "out", progress=False)
    assert {node.path for node in tree.subtree if node.has_data} == {
        "/",
        "/joints/closure",
        "/joints/rigid_dilatancy",
    }
    assert not any({"y", "x"} & set(node.to_dataset().variables) for node in tree.subtree)
    assert (tmp_path / "out" / "result.nc").stat().st_size < 200_000


def test_island_map_is_stored_only_where_it_is_kept(tmp_path):
    text = SOUND.replace('joints = ["closure", "rigid_dilatancy"]', 'domains = ["islands"]')
    plain, with_map = (
        fc.scenes.run(scene(tmp_path, text + more), progress=False)["domains/islands"].to_dataset()
        for more in ("", 'keep = ["label"]')
    )
    assert not {"label", "y", "x"} & set(plain.variables)
    assert with_map["label"].dims == ("shear", "step", "y", "x")
    assert plain["area"].equals(with_map["area"])


def test_root_of_a_file_states_the_main_results(tmp_path):
    """Plain xarray, which opens the root alone, shows the main numbers and where the others are."""
    more = 'dimensions = ["default", "spectrum"]\njoints = ["closure", "rigid_dilatancy"]'
    text = SOUND.replace('joints = ["closure", "rigid_dilatancy"]', more)
    tree = fc.scenes.run(scene(tmp_path, text), out=tmp_path / "out", progress=False)
    with xr.open_dataset(tmp_path / "out" / "result.nc") as root:
        assert not root.sizes
        closure = tree["joints/closure"].to_dataset()
        assert float(root.contact_fraction) == float(closure.contact_fraction.max())
        assert root.interface_closure.units == "m"
        assert "joints/closure" in root.interface_closure.long_name
        assert float(root.fractal_dimension) == float(tree["dimensions"].fractal_dimension[0])
        assert float(root.fractal_dimension_low) < float(root.fractal_dimension)
        assert "results by group: dimensions, joints/rigid_dilatancy, joints/closure" in root.comment
        assert "contacts are not resolved" in root.caveats


def test_jrc_without_spikes_is_that_of_the_wanted_call(tmp_path):
    """Along an azimuth, and with another regression, which gives another JRC of the same profiles."""
    scan = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=2e-5, rng=5)
    scan.values[[11, 30], [17, 42]] += 2e-3
    fc.save(scan, tmp_path / "scan.nc")
    options = {"direction": [37.5, "N"], "regression": "yu_vayssade", "lag": 5e-4}
    text = '[surface]\nread = "scan.nc"\n[joint.roughness_coefficient]\n'
    text += 'direction = [37.5, "N"]\nregression = "yu_vayssade"\nlag = 5e-4\n'
    text += '[want]\nsurfaces = ["height"]\njoints = ["roughness_coefficient"]\n'
    tree = fc.scenes.run(scene(tmp_path, text), progress=False)
    pair = (
        fc.joints.roughness_coefficient(surface, **options).roughness_coefficient.values
        for surface in (fc.surfaces.despike(scan), scan)
    )
    words = [
        f"{new:.0f}, not {old:.0f}, toward {name}"
        for new, old, name in zip(*pair, ("37.5°", "N"), strict=True)
    ]
    assert f"JRC is {', '.join(words)} (--despike)" in " ".join(tree.attrs["spikes"].split())


def test_summary_and_report_of_a_file_compute_nothing(tmp_path, monkeypatch):
    """The file has what the run compared: the scan without spikes, another form of friction."""
    scan = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=2e-5, rng=5)
    scan.values[[11, 30], [17, 42]] += 2e-3
    fc.save(scan, tmp_path / "scan.nc")
    generated = SOUND.partition("[surface]")[2].partition("[material]")[0]
    wanted = 'surfaces = ["height"]\ndimensions = ["default"]\n'
    wanted += 'joints = ["roughness_coefficient", "elastic_dilatancy", "friction"]'
    text = SOUND.replace(generated, '\nread = "scan.nc"\n')
    text = text.replace('joints = ["closure", "rigid_dilatancy"]', wanted)
    tree = fc.scenes.run(scene(tmp_path, text), out=tmp_path / "out", progress=False)
    expected = fc.scenes.summary(tree, verbose=True)
    words = " ".join(expected.split())
    assert "points that stand out as spikes of a scan: 2 of [surface]; without them D is" in words
    assert "JRC is" in words
    assert 'form = "energy"' in words

    def refuse(*_, **__):
        raise AssertionError("computed again")

    for subpackage in (fc.surfaces, fc.dimensions, fc.contact, fc.joints, fc.domains):
        for name in (name for name in subpackage.__all__ if name[0].islower()):
            monkeypatch.setattr(subpackage, name, refuse)
    stored = fc.open(tmp_path / "out" / "result.nc")
    assert fc.scenes.summary(stored, verbose=True) == expected
    page = fc.scenes.report(tmp_path / "out" / "result.nc", figures=())
    assert "stand out as spikes of a scan" in page.read_text(encoding="utf-8")
