"""The examples in docstrings and in the README run, and every public name has one."""

import doctest
import importlib
import importlib.util
import re
import textwrap
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.cli import command_help, main

SUBPACKAGES = ("surfaces", "dimensions", "contact", "domains", "joints", "accuracy", "scenes", "plotting")
ROOT = Path(__file__).resolve().parent.parent


def public_names():
    """Yield every public function and class as subpackage.name."""
    yield from ("save", "open")
    for subpackage in SUBPACKAGES:
        module = importlib.import_module(f"fractalcontact.{subpackage}")
        for name in module.__all__:
            if callable(getattr(module, name)):
                yield f"{subpackage}.{name}"


@pytest.mark.parametrize("subpackage", ["surfaces", "dimensions"])
def test_list_of_a_subpackage_has_every_public_name(subpackage):
    module = importlib.import_module(f"fractalcontact.{subpackage}")
    listed = {line.partition(" ")[0] for line in module.__doc__.splitlines()}
    assert {name for name in module.__all__ if callable(getattr(module, name))} <= listed


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mpl.use("Agg")
    yield
    plt.close("all")


def public_object(name):
    result = importlib.import_module("fractalcontact")
    for part in name.split("."):
        result = getattr(result, part)
    return result


@pytest.mark.parametrize("name", list(public_names()))
def test_docstring_example_runs(name):
    tests = [test for test in doctest.DocTestFinder().find(public_object(name), name) if test.examples]
    assert tests, f"{name} has no example"
    for test in tests:
        result = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE).run(test)
        assert result.failed == 0


@pytest.mark.parametrize("name", list(public_names()))
def test_docstring_starts_with_one_sentence_and_fits_a_screen(name):
    lines = public_object(name).__doc__.strip().splitlines()
    assert lines[0].endswith((".", "?")), lines[0]
    assert len(lines) == 1 or not lines[1].strip(), "one line of purpose, then a blank line"
    assert len(lines) <= LONGEST_DOCSTRING.get(name, 75)


# functions whose list of parameters and results alone is longer than a screen
LONGEST_DOCSTRING: dict[str, int] = {}


def test_readme_example_prints_what_is_shown(capsys):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    ((block, shown),) = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", text, flags=re.DOTALL)
    exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out == shown
    assert {path.name for path in Path().iterdir()} == {"closure.nc", "closure.png"}
    assert len(text.splitlines()) < 150


def test_words_of_the_index_name_public_functions():
    spec = importlib.util.spec_from_file_location("site_parts", ROOT / "gallery" / "site_parts.py")
    site_parts = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(site_parts)
    assert {f"fractalcontact.{name}" for name in public_names()} >= set(site_parts.INDEX)
    words = [word for names in site_parts.INDEX.values() for word in names]
    assert {"JRC", "closure law", "Hausdorff content", "Sq", "my own scan", "cluster"} <= set(words)
    assert len(words) == len(set(words))
    name = "fractalcontact.joints.roughness_coefficient"
    lines = ["Return the joint roughness coefficient."]
    site_parts.prepare_docstring(None, "function", name, None, None, lines)
    assert lines[:2] == [".. index::", "   single: JRC"]


def test_names_of_other_tools_exist():
    """Functions of this package and of the tools that are installed, as the page on other tools has them."""
    text = (ROOT / "gallery" / "coming_from.rst").read_text(encoding="utf-8")
    for path in re.findall(r"~fractalcontact\.([\w.]+)`", text):
        assert callable(public_object(path)), path
    topography = pytest.importorskip("SurfaceTopography")
    part = text.split("SurfaceTopography\n-----")[1].split("ContactMechanics and Tamaas\n---")[0]
    named = re.findall(r"\* - ``(\w+)", part)
    assert len(named) > 8
    flat = topography.Topography(np.zeros((4, 4)), (1.0, 1.0))
    places = (topography, flat, importlib.import_module("SurfaceTopography.Generation"))
    assert [name for name in named if not any(hasattr(place, name) for place in places)] == []
    from skimage import measure

    regions = measure.regionprops(np.pad(np.ones((2, 3), dtype=int), 1))
    part = text.split("scikit-image\n------------")[1]
    for name in re.findall(r"``measure\.(\w+)``", part):
        assert hasattr(measure, name)
    for name in ("orientation", "eccentricity", "solidity"):
        assert name in part
        assert hasattr(regions[0], name)


def test_links_of_the_readme_exist():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#]+)\)", text)
    assert len(links) > 10
    missing = [link for link in links if not link.startswith("https://") and not (ROOT / link).exists()]
    assert not missing


def test_loop_over_members_of_the_data_model_runs():
    text = (ROOT / "gallery" / "data_model.rst").read_text(encoding="utf-8")
    (block,) = re.findall(r"code-block:: python\n\n(.*?)(?=\n\S)", text, flags=re.DOTALL)
    names = {}
    exec(compile(textwrap.dedent(block), "data_model.rst", "exec"), names)
    for number, face in enumerate(names["faces"]):
        alone = fc.contact.press(face, contact_modulus=1e9, nominal_pressure=1e5)
        assert names["pressed"].contact_fraction[number].item() == alone.contact_fraction.item()
    assert {names[name].sizes["member"] for name in ("pressed", "roughness", "closed")} == {3}


PAGES = [page.name for page in sorted((ROOT / "gallery").glob("*.rst")) if ">>> " in page.read_text("utf-8")]


@pytest.mark.parametrize("page", PAGES)
def test_examples_of_a_page_run(page):
    """All blocks of a page in one namespace, in the order of the page."""
    text = (ROOT / "gallery" / page).read_text(encoding="utf-8")
    test = doctest.DocTestParser().get_doctest(text, {}, page, page, 0)
    result = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE).run(test)
    assert result.attempted > 0
    assert result.failed == 0


def test_page_of_commands_says_what_their_help_says(capsys):
    shown = command_help()
    with pytest.raises(SystemExit):
        main(["--help"])
    listed = re.findall(r"^    ([a-z]+)\b", capsys.readouterr().out, flags=re.MULTILINE)
    assert list(shown) == listed
    for name, words in shown.items():
        with pytest.raises(SystemExit):
            main([name, "--help"])
        assert capsys.readouterr().out == words


def test_scene_of_the_first_scan_runs():
    text = (ROOT / "gallery" / "first_scan.rst").read_text(encoding="utf-8")
    (scene,) = re.findall(r"code-block:: toml\n\n(.*?)(?=\n\S)", text, flags=re.DOTALL)
    heights = fc.surfaces.sample("concrete_crack").values[:144, :144]  # the block and its path
    np.savetxt("scan.csv", heights * 1e3, delimiter=",")
    Path("study.toml").write_text(textwrap.dedent(scene), encoding="utf-8")
    tree = fc.scenes.run("study.toml", out="out", progress=False)
    assert {path.name for path in Path("out").iterdir()} >= {"result.nc", "report.html", "islands.png"}
    assert tree["joints/closure/contact_fraction"].size == 3


def test_every_test_on_the_validation_page_exists():
    text = (ROOT / "gallery" / "validation.rst").read_text(encoding="utf-8")
    named = re.findall(r"``([a-z_]+/test_[a-z_]+\.py)``\n +\| ``(test_[a-z0-9_]+)``", text)
    assert len(named) > 20
    for file, name in named:
        assert f"def {name}(" in (ROOT / "tests" / file).read_text(encoding="utf-8"), (file, name)
