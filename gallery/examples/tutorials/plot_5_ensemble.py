"""
An ensemble on several workers
==============================

One surface is one draw. ``members`` makes an ensemble of them, and the study of each runs on its own:
here, on a cluster, or in other processes of this machine.
"""

from pathlib import Path

from matplotlib import pyplot as plt

import fractalcontact as fc

Path("ensemble.toml").write_text(
    """
title = "Contact of eight surfaces"

[surface]
generate = "spectral"
shape = [96, 96]
spacing = 1e-5
hurst = 0.8
rms_slope = 0.1
members = 8
rng = 1

[contact]
contact_modulus = 1e10
nominal_pressure = { first = 1e7, last = 1e9, count = 6 }

[want]
dimensions = ["default"]
contact = ["press"]
domains = ["box_dimension"]
""",
    encoding="utf-8",
)

# %%
# ``workers=2`` shares the members between two processes, and ``client=`` between the workers of a dask
# cluster; the results are the same, byte for byte. A script that uses workers must have an ``if __name__
# == "__main__":``. The command is ``fractalcontact run ensemble.toml -o ensemble --workers 2``.

tree = fc.scenes.run("ensemble.toml", out="ensemble", workers=0, progress=False)
print(tree["contact"].to_dataset())

# %%
# Every result has the dim ``member``.

area = tree["contact/contact_fraction"]
print((100 * area.mean("member")).round(2).values, "% in contact, mean")
print((100 * area.std("member", ddof=1)).round(2).values, "% standard deviation")
print(fc.scenes.summary(tree)[:1500])

# %%
# Median and the band of the central 68 % of the members. With ``figures = true`` in ``[want]`` the study
# draws such figures itself.

percent = 100 * area
pressure = tree["contact/nominal_pressure"].isel(member=0).values / 1e6
low, middle, high = (percent.quantile(share, "member").values for share in (0.16, 0.5, 0.84))
figure, ax = plt.subplots(figsize=(5, 3.6), layout="constrained")
ax.fill_between(pressure, low, high, alpha=0.3)
ax.loglog(pressure, middle, "o-")
ax.set(xlabel="nominal pressure (MPa)", ylabel="cells in contact (%)")
