"""The statements of the 1998 paper beside a study: right on a known joint, and from the file alone."""

import re

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.scenes import paper_table


@pytest.fixture(scope="module")
def tree():
    face = fc.surfaces.fbm((128, 128), 8e-5, hurst=0.78, rms_increment=2e-5, rng=3)
    face = fc.surfaces.level(face) + 0.1 * (face.x + face.y)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=64 * 8e-5)
    closing = fc.joints.closure(
        crack,
        shear=[8e-5, 2.4e-4, 8e-4],
        direction="W",
        normal_force=[5, 100, 300, 1e3, 2e3],
        keep=("state",),
    )
    opening = fc.joints.dilatancy(crack, shear=np.arange(0, 32) * 8e-5)
    pressed = fc.joints.dilatancy(crack, shear=[0.0, 8e-5, 4e-4], direction=["W"], normal_force=[50, 500])
    delta = fc.joints.delta_surface(crack, 8e-4, "W")
    return xr.DataTree.from_dict(
        {
            "/joints/closure": closing,
            "/joints/delta_surface": delta.to_dataset(name="height"),
            "/joints/rigid_dilatancy": opening,
            "/joints/elastic_dilatancy": pressed,
            "/joints/friction": fc.joints.friction(pressed),
            "/domains/box_dimension": fc.domains.box_dimension(closing.state),
        }
    )


def row(tree, words):
    """Return result and comparison of the statement with these words."""
    (line,) = [line for line in paper_table(tree).splitlines() if words in line]
    *_, result, agrees = re.split(r"  +", line)
    return result, agrees


def test_trends_of_a_self_affine_joint_agree(tree):
    for words in ("compliance", "equal F falls", "dimension above 2", "dilatancy falls with F"):
        assert row(tree, words)[1] == "yes", words
    inner = tree["joints/closure"].interface_closure.values[:, -1] * 1e6
    assert f"{inner[0]:.3g} to {inner[-1]:.3g} um" in row(tree, "compliance")[0]
    # few cells touch: the exponent is given, whether it is near enough to one or not
    assert row(tree, "proportional")[0].startswith("A ~ F^")
    assert "E +0.100, N +0.100, W -0.100" in row(tree, "mean slope")[0]
    assert row(tree, "two directions")[1] == "yes"


def test_disagreement_is_reported(tree):
    backwards = tree.copy()
    closing = tree["joints/closure"].to_dataset()
    for name in ("interface_closure", "contact_fraction"):
        closing[name] = closing[name].copy(data=closing[name].values[::-1])
    backwards["joints/closure"] = xr.DataTree(closing)
    assert row(backwards, "compliance")[1] == "no"
    assert row(backwards, "equal F falls")[1] == "no"


def test_table_from_the_file_alone_is_the_same(tree, tmp_path):
    path = fc.save(tree, tmp_path / "result.nc")
    assert paper_table(fc.open(path)) == paper_table(tree)
    assert fc.scenes.paper_table(xr.DataTree()) == ""
