"""Names and descriptions of the methods."""

import fractalcontact as fc

VALIDATED = ["likelihood", "increments"]


def test_descriptions():
    table = fc.dimensions.methods()
    assert next(iter(table)) == "likelihood"
    assert all(isinstance(line, str) and line.count("\n") == 0 for line in table.values())
    assert [name for name, line in table.items() if "95 % interval" in line] == VALIDATED


def test_psd_is_the_spectrum():
    surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    both = fc.dimensions.estimate(surface, ["spectrum", "psd"])
    assert both.method.values.tolist() == ["spectrum", "psd"]
    for name in ("hurst", "ci_low", "ci_high"):
        assert float(both[name][0]) == float(both[name][1])


def test_window_of_one_spacing_is_in_the_singular():
    rough = fc.surfaces.fbm((32, 32), 1e-3, hurst=0.5, rms_increment=1e-5, rng=1)
    rules = fc.dimensions.estimate(rough, ["higuchi", "variation", "spectrum"]).window_rule.values
    assert [rule.split(" to ")[0] for rule in rules] == ["1 spacing", "1 spacing", "4 spacings"]
