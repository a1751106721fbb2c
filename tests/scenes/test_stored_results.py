"""A result file holds the wanted results and nothing else."""

from study import SOUND

import fractalcontact as fc


def scene(tmp_path, text):
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    return tmp_path / "study.toml"


def test_file_has_the_wanted_results_and_no_map(tmp_path):
    tree = fc.scenes.run(scene(tmp_path, SOUND), out=tmp_path / "out", progress=False)
    assert {node.path for node in tree.subtree if node.has_data} == {
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
