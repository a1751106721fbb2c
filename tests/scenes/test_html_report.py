"""The report of a study: one HTML file whose surface, maps, tables and links are those of the result."""

import base64
import hashlib
import html
import io
import itertools
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from matplotlib.figure import Figure
from PIL import Image
from study import SOUND, command_here

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
STUDY = SOUND.replace(
    "[want]", "[want]\nsurfaces = ['height']\nkeep = ['state']\ndomains = ['signature']\nfigures = true"
)


class Page(HTMLParser):
    """Text of the elements with an id, links, and headings of a page."""

    def __init__(self, text):
        super().__init__()
        self.links, self.sections, self.pictures, self.data = [], [], [], {}
        self._id = None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.links += [attrs[name] for name in ("src", "href") if attrs.get(name)]
        if tag == "section":
            self.sections.append(attrs["id"])
        if tag == "script":
            self._id = attrs.get("id")

    def handle_data(self, data):
        if self._id:
            self.data[self._id] = json.loads(data)
            self._id = None


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    tree = fc.scenes.run(folder / "study.toml", out=folder / "out", progress=False)
    return tree, folder / "out"


@pytest.fixture(scope="module")
def page(study):
    return Page((study[1] / "report.html").read_text(encoding="utf-8"))


def surface_tree(height, **attributes):
    tree = xr.DataTree.from_dict({"/surfaces": height.to_dataset(name="height")})
    tree.attrs = attributes
    return tree


def page_of(tree, tmp_path):
    return Page(fc.scenes.report(tree, tmp_path / "page.html", figures=[]).read_text(encoding="utf-8"))


def test_every_run_writes_a_report_with_all_sections(page):
    assert page.sections == ["summary", "surface", "maps", "figures", "tables", "scene-and-provenance"]


def test_report_needs_no_network(study, page):
    assert len(page.links) > 10
    assert all(link.startswith(("data:", "#")) for link in page.links)
    assert "@import" not in (study[1] / "report.html").read_text(encoding="utf-8")
    assert (study[1] / "report.html").stat().st_size < 2e6


def test_every_figure_is_embedded(study, page):
    figures = [link for link in page.links if link.startswith("data:image/webp")]
    assert len(figures) == len(list(study[1].glob("*.png"))) > 3


def test_caveats_come_before_every_figure(study, page):
    text = (study[1] / "report.html").read_text(encoding="utf-8")
    assert "#caveats" in page.links
    assert text.index('id="caveats"') < text.index("<figure")


def test_captions_are_those_of_the_files(study, tmp_path):
    text = {"Description": "force <F> against closure \N{GREEK SMALL LETTER DELTA}"}
    files = [tmp_path / "with_words.png", tmp_path / "without.png"]
    for file, metadata in zip(files, (text, {}), strict=True):
        Figure((1.0, 1.0)).savefig(file, metadata=metadata)
    page = fc.scenes.report(study[0], tmp_path / "page.html", figures=files).read_text(encoding="utf-8")
    shown = re.findall(r"<figcaption><strong>(.*?)</strong>(.*?)</figcaption>", page)
    assert shown == [("With words", f": {html.escape(text['Description'])}"), ("Without", "")]


def test_references_are_those_of_the_groups(study):
    text = (study[1] / "report.html").read_text(encoding="utf-8")
    listed = re.findall("<li>([^<]*)</li>", text.partition("<h3>References</h3>")[2])
    own = [
        node.attrs["references"].split("; ") for node in study[0].descendants if "references" in node.attrs
    ]
    expected = [text for text in dict.fromkeys(itertools.chain(*own)) if text != "none"]
    assert [html.unescape(each) for each in listed] == expected


def test_input_files_are_listed_with_their_checksum(tmp_path):
    scan = fc.save(
        fc.surfaces.fbm((16, 16), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1), tmp_path / "scan.nc"
    )
    described = fc.surfaces.describe(fc.surfaces.read(scan))
    tree = xr.DataTree.from_dict({"/surfaces/description": described})
    text = fc.scenes.report(tree, tmp_path / "page.html", figures=[]).read_text(encoding="utf-8")
    digest = hashlib.sha256(scan.read_bytes()).hexdigest()
    assert re.search(rf'<th scope="row">scan.nc</th><td><code>{digest}</code>', text)


def test_maps_are_those_of_the_result(study, page):
    state = study[0]["joints/closure/state"]
    (maps,) = [each for each in page.data["map-data"] if len(each["axes"]) == state.ndim - 2]
    assert [len(axis["labels"]) for axis in maps["axes"]] == list(state.shape[:-2])
    flags = state.values.reshape(-1, *state.shape[-2:])
    assert len(maps["pictures"]) == len(flags)
    for picture, expected in zip(maps["pictures"], flags, strict=True):
        shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(picture))))
        np.testing.assert_array_equal(shown[::-1], expected)


def test_maps_are_labelled_by_the_load_that_was_prescribed(tmp_path):
    face = fc.surfaces.fbm((16, 16), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    for load, label in (("nominal_pressure", "p = 2 MPa"), ("normal_force", "F = 2 MN")):
        pressed = fc.contact.press(face, contact_modulus=1e9, **{load: [1e6, 2e6]}, keep=("state",))
        (maps,) = page_of(xr.DataTree.from_dict({"/contact": pressed}), tmp_path).data["map-data"]
        assert maps["axes"][0]["labels"][1] == label


def points(polyline):
    return np.array([pair.split(",") for pair in polyline.split()], float).reshape(-1, 2)


def test_signature_stands_beside_the_map_of_its_state(study, page):
    """A unit square: ln s across, the dimension from 0 to 2 upwards; the numbers are those of the summary."""
    signature, maps = study[0]["domains/signature"].to_dataset(), page.data["map-data"][0]
    states = [signature.isel(shear=i, step=k) for i in range(2) for k in range(signature.sizes["step"])]
    across = np.log(signature.side / signature.side[0]) / np.log(signature.side[-1] / signature.side[0])
    assert len(states) == len(maps["pictures"])
    for state, curve, marks, rows in zip(states, maps["curves"], maps["marks"], maps["rows"], strict=True):
        finite = np.isfinite(state.local_slope.values)
        expected = np.stack([across, 1 - state.local_slope.clip(0, 2) / 2], -1)[finite]
        np.testing.assert_allclose(points(curve), expected, atol=6e-4)
        for name, mark in zip(("spot_size", "gap_size"), marks, strict=True):
            place = np.interp(np.log(state[name]), np.log(signature.side), across, np.nan, np.nan)
            assert mark is None if np.isnan(place) else mark[0] == pytest.approx(place, abs=6e-4)
        flag = state.signature_flag.attrs["flag_meanings"].split()[int(state.signature_flag)]
        assert dict(rows)["D (random spots)"] == flag.replace("_", " ")
    assert any(mark for marks in maps["marks"] for mark in marks)


def test_maps_without_a_signature_have_none(study, tmp_path):
    groups = {"/joints": xr.Dataset(), "/joints/closure": study[0]["joints/closure"].to_dataset()}
    (maps,) = page_of(xr.DataTree.from_dict(groups), tmp_path).data["map-data"]
    assert "curves" not in maps


def test_captions_state_load_shear_and_shares(study, page):
    closure = study[0]["joints/closure"].to_dataset()
    last = closure.isel(shear=-1, step=-1)
    caption = page.data["map-data"][0]["alternatives"][-1]
    share = 100 * float((last["state"] > 0).mean())
    assert f"contact {share:.3g} %" in caption
    assert f"F = {float(last['normal_force']):.4g} N" in caption


def test_surface_levels_are_block_means(tmp_path):
    height = fc.surfaces.fbm((300, 200), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    height[:3, :3] = np.nan  # one block of 3 x 3 points
    surface = page_of(surface_tree(height), tmp_path).data["surface-data"]
    levels = (
        np.frombuffer(base64.b64decode(surface["heights"]), "<u2").reshape(surface["shape"]).astype(float)
    )
    means = height.values[:, :198].reshape(100, 3, 66, 3).mean(axis=(1, 3))
    assert levels[0, 0] == 65535
    assert np.isnan(means[0, 0])
    shown = surface["lowest"] + levels / 65534 * (surface["highest"] - surface["lowest"])
    half = (surface["highest"] - surface["lowest"]) / 65534
    np.testing.assert_allclose(shown.ravel()[1:], means.ravel()[1:], rtol=0, atol=half)
    np.testing.assert_allclose(surface["extent"], [300e-4, 198e-4])


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_surface_without_relief_is_no_fault(value, tmp_path):
    height = fc.surfaces.fbm((8, 8), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1) * 0 + value
    assert ("surface" in page_of(surface_tree(height), tmp_path).sections) == np.isfinite(value)


def test_csv_links_hold_the_curves(study, page):
    closure = study[0]["joints/closure"].to_dataset()
    links = [link for link in page.links if link.startswith("data:text/csv")]
    texts = [base64.b64decode(link.partition(",")[2]).decode() for link in links]
    (csv,) = [
        pd.read_csv(io.StringIO(text)) for text in texts if "interface_closure (m)" in text.split("\n")[0]
    ]
    expected = closure["interface_closure"].values.ravel()
    np.testing.assert_allclose(csv["interface_closure (m)"], expected, rtol=1e-8)


def test_a_table_of_many_rows_is_not_in_the_page(tmp_path):
    height = fc.surfaces.fbm((8, 8), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    sizes = {count: {} for count in (1_000, 60_000)}
    for count, page in sizes.items():
        tree = surface_tree(height)
        areas = xr.DataArray(np.linspace(0.1, 0.9, count), dims="island", attrs={"units": "m2"})
        tree["domains/islands"] = xr.DataTree(xr.Dataset({"island_area": areas}))
        text = fc.scenes.report(tree, tmp_path / f"{count}.html", figures=[]).read_text(encoding="utf-8")
        page |= {"links": text.count("domains_islands_by_island.csv</a>"), "bytes": len(text)}
        assert ("fractalcontact report result.nc --csv tables" in text) == (count == 60_000)
    assert [page["links"] for page in sizes.values()] == [1, 0]
    assert max(page["bytes"] for page in sizes.values()) < 200_000


def test_text_of_the_study_cannot_become_markup(tmp_path):
    height = fc.surfaces.fbm((8, 8), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    hostile = "</script><script>document.title = 'taken over'</script>"
    path = fc.scenes.report(
        surface_tree(height, title=hostile, references=hostile), tmp_path / "page.html", figures=[]
    )
    assert hostile not in path.read_text(encoding="utf-8")


def test_many_maps_are_thinned_evenly(tmp_path):
    steps, shears = np.arange(60) * 1e3, np.arange(30) * 1e-4
    state = xr.DataArray(
        np.zeros((30, 60, 4, 4), np.int8), dims=("shear", "step", "y", "x"), coords={"shear": shears},
        attrs={"flag_values": np.array([0, 1], np.int8), "flag_meanings": "open contact"},
    )  # fmt: skip
    state["shear"].attrs["units"] = "m"
    force = xr.DataArray(steps, dims="step", attrs={"units": "N"})
    tree = xr.DataTree.from_dict({"/maps": xr.Dataset({"state": state}, coords={"normal_force": force})})
    (maps,) = page_of(tree, tmp_path).data["map-data"]
    assert len(maps["pictures"]) <= 120
    shear, step = (axis["labels"] for axis in maps["axes"])
    assert (shear[0], shear[-1]) == ("0 m", "2.9 mm")
    assert (step[0], step[-1]) == ("F = 0 N", "F = 59 kN")


def test_large_maps_show_the_highest_flag_of_a_block(tmp_path):
    flags = np.zeros((900, 900), np.int8)
    flags[899, 0] = 1
    attributes = {"flag_values": np.array([0, 1], np.int8), "flag_meanings": "open contact"}
    state = xr.DataArray(flags, dims=("y", "x"), attrs=attributes)
    (maps,) = page_of(xr.DataTree.from_dict({"/maps": state.to_dataset(name="state")}), tmp_path).data[
        "map-data"
    ]
    shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(maps["pictures"][0]))))
    assert shown.shape == (300, 300)
    assert shown[0, 0] == 1
    assert shown.sum() == 1


def test_command_writes_report_and_csv(study, tmp_path):
    _, out = study
    answer = command_here(
        "report", out / "result.nc", "-o", tmp_path / "again.html", "--csv", tmp_path / "csv"
    )
    assert answer.returncode == 0, answer.stderr
    assert "maps" in Page((tmp_path / "again.html").read_text(encoding="utf-8")).sections
    assert (tmp_path / "csv" / "joints_closure_by_shear_step.csv").is_file()


def test_report_of_something_else_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match="result: expected a DataTree or a file"):
        fc.scenes.report(3)
    height = fc.surfaces.fbm((8, 8), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    path = fc.save(height, tmp_path / "height.nc")
    with pytest.raises(InvalidInput, match="the file of a study"):
        fc.scenes.report(path)
    with pytest.raises(InvalidInput, match="path: expected the file to write"):
        fc.scenes.report(surface_tree(height))


def test_tables_hold_every_variable_but_maps(study):
    tree = study[0]
    columns = {column.split(" (")[0] for frame in fc.scenes.tables(tree).values() for column in frame.columns}
    for node in tree.subtree:
        for name, variable in node.data_vars.items():
            assert ({"x", "y"} & set(variable.dims)) or name in columns, (node.path, name)


def test_tables_of_the_page_show_rounding_as_zero(tmp_path):
    """The mean of levelled heights is some 1e-21 m, here below zero."""
    data = xr.Dataset(
        {"mean_height": ("scan", [-3e-21, 0.0, -0.0], {"units": "m", "long_name": "mean height"})}
    )
    page = fc.scenes.report(xr.DataTree.from_dict({"surfaces": data}), tmp_path / "page.html", figures=())
    text = page.read_text(encoding="utf-8")
    assert "mean height (m)" in text
    assert not re.search(r"mean height \(fm\)|-0<|-3e-21", text)


def test_flags_are_words_in_the_tables(study, tmp_path):
    frames = fc.scenes.tables(study[0], tmp_path)
    for name, group, flag in (
        ("joints_closure_by_shear_step", "joints/closure", "stop_reason"),
        ("domains_signature_by_shear_step", "domains/signature", "signature_flag"),
    ):
        variable = study[0][f"{group}/{flag}"]
        words = variable.attrs["flag_meanings"].split()
        expected = [words[list(variable.attrs["flag_values"]).index(value)] for value in variable.values.flat]
        assert list(frames[name][flag]) == expected
        assert list(pd.read_csv(tmp_path / f"{name}.csv")[flag]) == expected


def test_table_of_a_curve_equals_the_curve(study):
    closure = study[0]["joints/closure"].to_dataset()
    frame = fc.scenes.tables(study[0])["joints_closure_by_shear_step"]
    np.testing.assert_array_equal(frame["contact_area (m2)"], closure["contact_area"].values.ravel())
    np.testing.assert_array_equal(
        frame["shear (m)"], np.repeat(closure["shear"].values, closure.sizes["step"])
    )


@pytest.fixture
def browse(tmp_path):
    """Return a function that opens a page in Chromium without a window, with more flags."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip("no Chromium on this machine")

    def opened(page, *flags):
        command = [browser, "--headless", "--no-sandbox", "--disable-gpu", *flags,
                   f"--user-data-dir={tmp_path / 'profile'}", page.as_uri()]  # fmt: skip
        return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)

    return opened


def test_only_open_tables_are_printed(study, browse, tmp_path):
    text = (study[1] / "report.html").read_text(encoding="utf-8")
    assert text.count("<details>") > 5
    contents = {}
    for name, tag in (("closed", "<details>"), ("open", "<details open>")):
        page, printed = tmp_path / f"{name}.html", tmp_path / f"{name}.pdf"
        page.write_text(text.replace("<details>", tag), encoding="utf-8")
        browse(page, f"--print-to-pdf={printed}")
        contents[name] = printed.read_bytes()
    assert len(re.findall(rb"/Type /Page\b", contents["closed"])) <= 8
    link = b"data:text/csv"  # above each printed table
    assert link in contents["open"]
    assert link not in contents["closed"]


def test_report_works_in_a_browser(study, browse, tmp_path):
    """Move a slider and turn the surface in Chromium: the map and the picture change, nothing is reported."""
    text = (study[1] / "report.html").read_text(encoding="utf-8")
    moves = """<script>
      const noted = {};
      const note = (name) => { noted[name] = [element("map-0").src, element("surface-view").toDataURL(),
                                              element("map-caption-0").textContent,
                                              element("slopes-0").getAttribute("points"),
                                              element("signature-0").textContent]; };
      note("before");
      element("axis-0-1").value = 0;
      element("axis-0-1").dispatchEvent(new Event("input"));
      element("surface-view").dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
      note("after");
      document.body.innerHTML = "<p id='noted'>" + JSON.stringify(noted) + "</p>";
    </script>"""
    page = tmp_path / "page.html"
    page.write_text(text.replace("</body>", moves + "</body>"), encoding="utf-8")
    answer = browse(page, "--enable-logging=stderr", "--virtual-time-budget=5000", "--dump-dom")
    assert "CONSOLE" not in answer.stderr
    noted = json.loads(re.search('<p id="noted">(.*?)</p>', answer.stdout, re.DOTALL)[1])
    for before, after in zip(noted["before"], noted["after"], strict=True):
        assert before
        assert after
        assert before != after


class Summary(HTMLParser):
    """Headings, cells and remarks of the summary of a page."""

    def __init__(self, text):
        super().__init__()
        self.found, self._open = [], None
        self.feed(text.partition('<section id="summary">')[2].partition("</section>")[0])

    def handle_starttag(self, tag, attrs):
        self._open = tag
        if tag in ("h3", "th", "td", "p", "pre"):
            self.found.append((tag, ""))

    def handle_data(self, data):
        if self._open in ("h3", "th", "td", "p", "pre"):
            self.found[-1] = (self._open, self.found[-1][1] + data)

    def handle_endtag(self, tag):
        self._open = None


def test_summary_has_the_words_of_the_text_as_tables(study):
    tree, folder = study
    found = Summary((folder / "report.html").read_text(encoding="utf-8")).found
    tags = {tag for tag, _ in found}
    assert "pre" not in tags  # it would scroll sideways on a narrow screen
    assert {"h3", "th", "td", "p"} <= tags
    headings = [words for tag, words in found if tag == "h3"]
    assert {"Closure", "Stages of the run"} <= set(headings)
    assert "Caveats" in headings
    text = " ".join(fc.scenes.summary(tree, verbose=True).split())
    cells = [words for tag, words in found if tag in ("td", "p") and words]
    assert len(cells) > 20
    times = re.compile(r"\d+\.\d\d")  # of the report itself, which were not known when it was written
    with_time = {words for words in cells if times.fullmatch(words)}
    missing = [words for words in cells if words not in with_time and words.split()[0] not in text]
    assert not missing
