"""
A measured joint, from two PLY files to its datasheet
=====================================================

Two scans of the faces of a joint are gridded in one plane, and answer the questions of an engineer: how
rough is the joint, how far is it open, how does it close under load, how much water flows, and how strong
is it. Reading PLY files needs the extra ``mesh``.
"""

from pathlib import Path

import numpy as np
import trimesh
import xarray as xr

import fractalcontact as fc

# %%
# Two synthetic clouds stand in for the scans: a tilted face, in millimetres, and one that matches it,
# scanned at other points and lifted by 0.3 mm. Replace this block by your own files.

face = fc.surfaces.fbm((128, 128), 0.5e-3, hurst=0.75, rms_increment=1.2e-4, rng=3)
rng = np.random.default_rng(1)
for name, lift in (("lower.ply", 0.0), ("upper.ply", 0.3e-3)):
    x, y = rng.uniform(1e-3, 63e-3, (2, 20000))
    z = face.interp(x=xr.DataArray(x, dims="point"), y=xr.DataArray(y, dims="point")).values + lift
    trimesh.PointCloud(1e3 * np.c_[x, y, z + 0.1 * x]).export(name)

# %%
# The lower scan is gridded above its best-fit plane. ``plane=lower`` puts the upper one on the same plane
# and the same cells, so that their difference is the opening. Cells at the border without points around
# them are missing.

lower = fc.surfaces.read("lower.ply", units="mm", spacing=0.5e-3)
upper = fc.surfaces.read("upper.ply", units="mm", plane=lower)
aperture = upper - lower
print(lower)
print(f"mean aperture {1e3 * aperture.mean():.3f} mm, {int(lower.isnull().sum())} cells missing")
relief = fc.plotting.surface(lower)

# %%
# Roughness. The interval of the dimension holds what gridding may have done; JRC is that of profiles
# towards E and N.

estimate = fc.dimensions.estimate(lower).isel(method=0)
low, high = estimate.fractal_dimension_low, estimate.fractal_dimension_high
print(f"fractal dimension {estimate.fractal_dimension:.2f}, 95 % interval {low:.2f} to {high:.2f}")
jrc = fc.joints.roughness_coefficient(lower)
for one in jrc.roughness_coefficient:
    print(f"JRC towards {one.direction.item()}: {one:.1f}")
rose = fc.plotting.directional_roughness(fc.joints.directional_roughness(lower))

# %%
# Closure and transmissivity of a block of 40 mm: the faces close under load, and the flow falls.

crack = fc.joints.Crack(lower, upper, young=30e9, poisson=0.2, block=0.04)
closure = fc.joints.closure(crack, shear=0.0, nominal_pressure=[1e5, 3e5, 1e6, 3e6], keep=["state", "gap"])
flow = fc.joints.transmissivity(closure.gap)
print(crack)
print(flow.hydraulic_aperture)
laws = fc.plotting.plot(closure)
opening = fc.plotting.plot(flow)

# %%
# The same files as a scene. ``datasheet = true`` adds what a datasheet shows: roughness, strength,
# closure and flow, with every curve as a CSV file. ``plane = "surface"`` is the plane and the cells of
# ``[surface]``.

Path("joint.toml").write_text(
    """
[surface]
read = "lower.ply"
units = "mm"
spacing = 0.5e-3
fill = true

[upper]
read = "upper.ply"
units = "mm"
plane = "surface"
fill = true

[material]
young = 30e9
poisson = 0.2
basic_friction_angle = 32.0

[joint]
block = 0.04
direction = "E"
nominal_pressure = [1e5, 3e5, 1e6, 3e6]

[joint.closure]
shear = [0.0, 1e-3]

[joint.strength_envelope]
wall_strength = 80e6
residual_friction_angle = 28.0
cohesion = 1e6

[want]
datasheet = true
""",
    encoding="utf-8",
)
study = fc.scenes.run("joint.toml", out="joint", progress=False)
print(sorted(path.name for path in Path("joint").iterdir() if not path.name.startswith(".")))
sheet = fc.scenes.datasheet(study)
