"""What a scene may say: its tables, their keys, and the words of `[want]`.

The keys are argument names of the public functions. Those of a generator are read from its signature when
the scene is checked, so that they stand in one place.
"""

from __future__ import annotations

from collections.abc import Mapping

READING = ("read", "sample", "channel", "units", "spacing", "level", "fill")
GENERATORS = ("fbm", "spectral", "midpoint", "weierstrass")
SAMPLES = ("concrete_crack", "jacksboro_fault_dem")

MATERIAL = ("young", "poisson", "basic_friction_angle", "hardness")
JOINT = ("block", "direction", "shear", "normal_force", "nominal_pressure", "register")
CONTACT = (
    "contact_modulus",
    "closure",
    "normal_force",
    "nominal_pressure",
    "boundary",
    "influence",
    "disc_radius",
    "hardness",
    "tolerance",
    "method",
)

# the sub-table [joint.<stage>] gives one stage values of its own
JOINT_STAGES: Mapping[str, tuple[str, ...]] = {
    "delta_surface": ("shear", "direction"),
    "closure": ("shear", "direction", "closure", "normal_force", "nominal_pressure"),
    "rigid_dilatancy": ("shear", "direction"),
    "elastic_dilatancy": ("shear", "direction", "normal_force"),
    "friction": ("smoothing",),
    "decorrelation_length": ("shear", "direction"),
    "transmissivity": ("viscosity",),
}
DOMAIN_STAGES: Mapping[str, tuple[str, ...]] = {
    "box_dimension": ("scales", "cover"),
    "lacunarity": ("box_sizes",),
    "islands": ("connectivity",),
    "boundary_dimension": (),
    "percolation": (),
    "describe": (),
    "evolution": (),
}

WANTED: Mapping[str, tuple[str, ...]] = {
    "surfaces": ("height", "describe"),
    "contact": ("press",),
    "joints": tuple(JOINT_STAGES),
    "domains": tuple(DOMAIN_STAGES),
    "keep": ("state", "pressure", "gap"),
}
DIMENSION_OPTIONS = ("scales", "noise")
TABLES = ("title", "surface", "upper", "material", "contact", "joint", "dimensions", "domains", "want")

# bounds of the plain numbers of a scene: (above, at_least, below)
BOUNDS: Mapping[str, tuple[float | None, float | None, float | None]] = {
    "young": (0.0, None, None),
    "poisson": (-1.0, None, 0.5),
    "basic_friction_angle": (None, 0.0, 90.0),
    "hardness": (0.0, None, None),
    "contact_modulus": (0.0, None, None),
    "tolerance": (0.0, None, 1.0),
    "block": (0.0, None, None),
    "shear": (None, 0.0, None),
    "normal_force": (None, 0.0, None),
    "nominal_pressure": (None, 0.0, None),
    "closure": (None, 0.0, None),
    "smoothing": (0.0, None, None),
    "viscosity": (0.0, None, None),
    "spacing": (0.0, None, None),
}
