"""Labels: every name has a valid unit, and nothing is inherited."""

import pytest
import xarray as xr

from fractalcontact.base import schema


def test_unknown_name_is_an_error():
    with pytest.raises(KeyError, match="'nonsense' has no unit: give it a Quantity in"):
        schema.label(xr.Dataset({"nonsense": 1.0}))


def test_labels_are_not_inherited():
    spoiled = xr.DataArray([1.0, 4.0], dims="step", coords={"step": [0, 1]}, name="gap")
    spoiled.attrs["units"] = "furlong"
    assert schema.label(spoiled).attrs == {"long_name": "gap between the bodies", "units": "m"}


def test_every_unit_is_valid_udunits():
    Unit = pytest.importorskip("cf_units", reason="could not import 'cf_units': units are not checked").Unit
    for name, quantity in schema.QUANTITIES.items():
        if quantity.units is not None:
            Unit(quantity.units)
        assert quantity.long_name, name
    assert "load" not in schema.QUANTITIES
