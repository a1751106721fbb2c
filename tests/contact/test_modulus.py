"""The contact modulus of two bodies: closed forms, limits, and what is refused."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

modulus = fc.contact.effective_modulus


def test_equal_bodies():
    assert modulus(30e9, 0.2) == pytest.approx(30e9 / (2 * 0.96), rel=1e-15)
    assert modulus(30e9, 0.2, 30e9, 0.2) == modulus(30e9, 0.2)


def test_compliances_add():
    both = modulus(30e9, 0.2, 210e9, 0.3)
    assert 1 / both == pytest.approx(0.96 / 30e9 + 0.91 / 210e9, rel=1e-15)
    assert both == modulus(210e9, 0.3, 30e9, 0.2)


@pytest.mark.parametrize("rigid", [(np.inf,), (np.inf, 0.3), (np.inf, None)])
def test_rigid_second_body(rigid):
    assert modulus(1e9, 0.3, *rigid) == pytest.approx(1e9 / 0.91, rel=1e-15)
    assert modulus(1e9, 0.3, 1e30, 0.3) == pytest.approx(modulus(1e9, 0.3, *rigid), rel=1e-15)
    if len(rigid) == 2 and rigid[1]:
        assert modulus(*rigid, 1e9, 0.3) == modulus(1e9, 0.3, *rigid)


def test_incompressible_and_auxetic():
    assert modulus(1e6, 0.5, np.inf) == pytest.approx(4e6 / 3, rel=1e-15)
    assert modulus(1e6, -0.5, np.inf) == modulus(1e6, 0.5, np.inf)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        ((30e9, 0.2, None, 0.3), ("poisson2", "young2")),
        ((30e9, 0.2, 1e9), ("poisson2",)),
        ((np.inf, 0.2), ("rigid",)),
        ((np.inf, 0.2, np.inf), ("rigid",)),
        ((0.0, 0.5001), ("young", "poisson")),
        ((1e9, -1.0), ("poisson",)),
        ((np.nan, None), ("young", "poisson")),
        ((1e9, 0.3, -np.inf, 0.3), ("young2",)),
    ],
)
def test_incomplete_body_is_refused(call, words):
    with pytest.raises(InvalidInput) as caught:
        modulus(*call)
    for word in words:
        assert word in str(caught.value)


def test_blocks_are_springs_in_series():
    def stiffness(*bodies):
        return fc.contact.flat_stiffness((24, 16), 1e-3, contact_modulus=modulus(*bodies))

    pair = stiffness(1e6, 0.3, 4e6, 0.45)
    alone = stiffness(1e6, 0.3, np.inf), stiffness(4e6, 0.45, np.inf)
    assert 1 / pair == pytest.approx(1 / alone[0] + 1 / alone[1], rel=1e-14)


def test_concrete_pair_and_nearly_rigid_body():
    assert fc.contact.effective_modulus(30e9, 0.2) == pytest.approx(30e9 / (2 * 0.96))
    soft_and_rigid = fc.contact.effective_modulus(1e9, 0.3, 1e30, 0.3)
    assert soft_and_rigid == pytest.approx(1e9 / 0.91)


def test_poisson_of_a_pair():
    """By hand: weights 2 (1 + nu)/E of 2.4/30 and 2.6/60 for .2 and .3; and that of the elastic body."""
    assert fc.contact.effective_poisson(30e9, 0.2, 60e9, 0.3) == pytest.approx(0.235135135, rel=1e-8)
    assert fc.contact.effective_poisson(1e9, 0.4) == 0.4
    assert fc.contact.effective_poisson(1e9, 0.4, np.inf) == pytest.approx(0.4, rel=1e-15)
    assert fc.contact.effective_poisson(np.inf, None, 1e9, 0.3) == pytest.approx(0.3, rel=1e-15)
    with pytest.raises(InvalidInput, match="poisson2"):
        fc.contact.effective_poisson(1e9, 0.2, 1e9)
